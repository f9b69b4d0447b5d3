//! Little-endian payload fields: checked reads, bounded writes.

use headrace_sensor::codec::{Bytes, TooLong};

use super::frame::MAX_FRAME_BYTES;

/// A frame whose payload is being written.
pub(super) type Payload = Bytes<MAX_FRAME_BYTES>;

/// One or several consecutive fields of fixed length.
pub(super) trait Field: Sized {
    /// Length of the fields in bytes.
    const LEN: usize;

    /// Reads the fields off the front of `from`; `None` if bytes are missing.
    fn read(from: &mut &[u8]) -> Option<Self>;

    /// Appends the fields to the payload.
    fn write(&self, to: &mut Payload) -> Result<(), TooLong>;
}

macro_rules! integers {
    ($($type:ty),*) => {$(
        impl Field for $type {
            const LEN: usize = size_of::<$type>();

            fn read(from: &mut &[u8]) -> Option<Self> {
                let (bytes, rest) = from.split_first_chunk()?;
                *from = rest;
                Some(<$type>::from_le_bytes(*bytes))
            }

            fn write(&self, to: &mut Payload) -> Result<(), TooLong> {
                to.extend(&self.to_le_bytes())
            }
        }
    )*};
}

integers!(u8, u16, u32);

/// Any value except 0 is true.
impl Field for bool {
    const LEN: usize = 1;

    fn read(from: &mut &[u8]) -> Option<Self> {
        u8::read(from).map(|value| value != 0)
    }

    fn write(&self, to: &mut Payload) -> Result<(), TooLong> {
        u8::from(*self).write(to)
    }
}

/// Defines a struct whose fields are consecutive on the wire.
macro_rules! record {
    ($(#[$meta:meta])* $name:ident { $($(#[$field_meta:meta])* $field:ident: $type:ty,)* }) => {
        $(#[$meta])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        pub struct $name {
            $($(#[$field_meta])* pub $field: $type,)*
        }

        impl Field for $name {
            const LEN: usize = 0 $(+ <$type as Field>::LEN)*;

            fn read(from: &mut &[u8]) -> Option<Self> {
                Some(Self { $($field: Field::read(from)?,)* })
            }

            fn write(&self, to: &mut Payload) -> Result<(), TooLong> {
                $(self.$field.write(to)?;)*
                Ok(())
            }
        }
    };
}

pub(super) use record;
