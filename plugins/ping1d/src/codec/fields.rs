//! Little-endian fields of a payload: read with a check, written with a bound.

use headrace_sensor::codec::{Bytes, TooLong};

use super::MAX_PAYLOAD_BYTES;

/// A payload as it is put together.
pub(super) type Payload = Bytes<MAX_PAYLOAD_BYTES>;

/// A field, or several in a row, of fixed length.
pub(super) trait Field: Sized {
    /// Bytes that it takes.
    const LEN: usize;

    /// Takes it off the front of `from`; `None` when the bytes aren't there.
    fn read(from: &mut &[u8]) -> Option<Self>;

    /// Appends it.
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

/// Anything but 0 is true.
impl Field for bool {
    const LEN: usize = 1;

    fn read(from: &mut &[u8]) -> Option<Self> {
        u8::read(from).map(|value| value != 0)
    }

    fn write(&self, to: &mut Payload) -> Result<(), TooLong> {
        u8::from(*self).write(to)
    }
}

/// A struct whose fields stand in a row on the wire.
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
