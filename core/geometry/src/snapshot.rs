//! Snapshots: the state after a tick as bytes. A loop of the same vehicle and program can restore it.
//!
//! Serde writes plain values: numbers, enums, small records. Other types are restored in place, because they have
//! preallocated memory or contain settings that are not part of the state. [`stateful!`](crate::stateful) classifies
//! every field of such a type, so that a new field cannot be forgotten.
//!
//! ```
//! use headrace_geometry::snapshot::{Restorer, Saver, Stateful as _, stateful};
//!
//! struct Counter {
//!     name: &'static str,
//!     count: u64,
//! }
//! stateful!(Counter { state: count; fixed: name; });
//!
//! let mut saver = Saver::default();
//! Counter { name: "first", count: 3 }.save(&mut saver);
//! let bytes = saver.finish()?;
//!
//! let mut other = Counter { name: "second", count: 0 };
//! other.restore(&mut Restorer::new(&bytes))?;
//! assert_eq!((other.name, other.count), ("second", 3));
//! # Ok::<(), headrace_geometry::snapshot::SnapshotError>(())
//! ```
//!
//! A snapshot can be read only by the version of the program that wrote it.

use serde::Serialize;
use serde::de::DeserializeOwned;

/// State that can be saved and restored to continue a run.
pub trait Stateful {
    /// Appends the state to a snapshot.
    fn save(&self, to: &mut Saver);

    /// Restores the state from a snapshot, in the order in which it was saved.
    ///
    /// Keeps settings and buffer capacities.
    ///
    /// Errors: the snapshot does not fit. `self` may then be partly restored and must not be used.
    fn restore(&mut self, from: &mut Restorer<'_>) -> Result<(), SnapshotError>;
}

/// Reason why a snapshot cannot be written or restored.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum SnapshotError {
    /// The bytes do not fit the loop that restores them.
    #[error("restoring {part} from a snapshot: {why}; it is from another vehicle or version, or damaged")]
    Unfit {
        /// Name of the part of the state that was being restored.
        part: String,
        /// The cause of the failure to restore.
        why: String,
    },
    /// A value cannot be written.
    #[error("saving {part}: {why}")]
    Unsaved {
        /// Name of the part of the state that was being saved.
        part: String,
        /// The cause of the failure to save.
        why: String,
    },
}

/// Writer of a snapshot.
#[derive(Debug, Default)]
pub struct Saver {
    bytes: Vec<u8>,
    failed: Option<SnapshotError>,
    part: &'static str,
}

impl Saver {
    /// Begins a named part of the state. The name is written too, so that errors can report it.
    pub fn part(&mut self, name: &'static str) {
        self.part = name;
        self.value(&name);
    }

    /// Appends a value to the snapshot.
    pub fn value(&mut self, value: &(impl Serialize + ?Sized)) {
        match postcard::to_extend(value, core::mem::take(&mut self.bytes)) {
            Ok(bytes) => self.bytes = bytes,
            Err(error) => {
                let error = SnapshotError::Unsaved { part: self.part.to_owned(), why: error.to_string() };
                self.failed.get_or_insert(error);
            }
        }
    }

    /// Appends a list to the snapshot, preceded by its length.
    pub fn list<T: Serialize>(&mut self, list: &[T]) {
        self.value(&list.len());
        for element in list {
            self.value(element);
        }
    }

    /// Appends stateful elements. Their number is not written, because it is a setting.
    pub fn each<'a, T: Stateful + ?Sized + 'a>(&mut self, each: impl Iterator<Item = &'a T>) {
        each.for_each(|one| one.save(self));
    }

    /// Appends raw bytes, preceded by their length.
    pub fn raw(&mut self, bytes: &[u8]) {
        self.value(&bytes.len());
        self.bytes.extend_from_slice(bytes);
    }

    /// Returns the complete snapshot.
    ///
    /// Errors: a value could not be written.
    pub fn finish(self) -> Result<Vec<u8>, SnapshotError> {
        self.failed.map_or(Ok(self.bytes), Err)
    }
}

/// Reader of a snapshot.
#[derive(Debug)]
pub struct Restorer<'a> {
    bytes: &'a [u8],
    part: &'static str,
}

impl<'a> Restorer<'a> {
    /// Creates a reader of a snapshot that [`Saver::finish`] returned.
    pub fn new(bytes: &'a [u8]) -> Self {
        Self { bytes, part: "the beginning" }
    }

    /// Begins reading the part of the state with this name.
    ///
    /// Errors: the next part has another name.
    pub fn part(&mut self, name: &'static str) -> Result<(), SnapshotError> {
        self.part = name;
        let found: &str = self.take()?;
        if found == name { Ok(()) } else { Err(self.unfit(format!("found part {found:?} instead"))) }
    }

    /// Reads a value.
    ///
    /// Errors: the next bytes aren't a value of this type.
    pub fn value<T: DeserializeOwned>(&mut self) -> Result<T, SnapshotError> {
        self.take()
    }

    fn take<T: serde::Deserialize<'a>>(&mut self) -> Result<T, SnapshotError> {
        let (value, rest) =
            postcard::take_from_bytes(self.bytes).map_err(|error| self.unfit(error.to_string()))?;
        self.bytes = rest;
        Ok(value)
    }

    /// Reads a list into a `Vec`, without allocation if the capacity suffices.
    ///
    /// Errors: the snapshot is too short, or an element can't be read.
    pub fn list<T: DeserializeOwned>(&mut self, list: &mut Vec<T>) -> Result<(), SnapshotError> {
        let count: usize = self.value()?;
        if count > self.bytes.len() {
            return Err(self.unfit(format!("{count} elements in {} bytes", self.bytes.len())));
        }
        list.clear();
        list.reserve_exact(count);
        for _ in 0..count {
            list.push(self.value()?);
        }
        Ok(())
    }

    /// Reads a list into a slice of the same length.
    ///
    /// Errors: the snapshot has another length, or an element can't be read.
    pub fn slots<T: DeserializeOwned>(&mut self, slots: &mut [T]) -> Result<(), SnapshotError> {
        let count: usize = self.value()?;
        if count != slots.len() {
            return Err(self.unfit(format!("{count} elements in place of {}", slots.len())));
        }
        slots.iter_mut().try_for_each(|slot| self.value().map(|value| *slot = value))
    }

    /// Restores stateful elements in place. Their number is a setting, so it is not read.
    ///
    /// Errors: the first error of an element.
    pub fn each<'t, T: Stateful + ?Sized + 't>(
        &mut self,
        mut each: impl Iterator<Item = &'t mut T>,
    ) -> Result<(), SnapshotError> {
        each.try_for_each(|one| one.restore(self))
    }

    /// Reads raw bytes.
    ///
    /// Errors: the snapshot ends early.
    pub fn raw(&mut self) -> Result<&'a [u8], SnapshotError> {
        let count: usize = self.value()?;
        let (bytes, rest) =
            self.bytes.split_at_checked(count).ok_or_else(|| self.unfit("it ends early".to_owned()))?;
        self.bytes = rest;
        Ok(bytes)
    }

    /// Creates an error about the part that is being restored.
    pub fn unfit(&self, why: String) -> SnapshotError {
        SnapshotError::Unfit { part: self.part.to_owned(), why }
    }

    /// Whether all bytes of the snapshot have been read.
    pub fn is_empty(&self) -> bool {
        self.bytes.is_empty()
    }
}

impl<T: Serialize + DeserializeOwned> Stateful for T {
    fn save(&self, to: &mut Saver) {
        to.value(self);
    }

    fn restore(&mut self, from: &mut Restorer<'_>) -> Result<(), SnapshotError> {
        *self = from.value()?;
        Ok(())
    }
}

/// Serde module (`#[serde(with = ...)]`) for arrays longer than serde supports.
pub mod array {
    use serde::de::{Deserialize, Deserializer, Error};
    use serde::ser::{Serialize, Serializer};

    /// Serialises the array as a list.
    pub fn serialize<S: Serializer, T: Serialize, const N: usize>(
        array: &[T; N],
        to: S,
    ) -> Result<S::Ok, S::Error> {
        to.collect_seq(array)
    }

    /// Deserialises a list of `N` elements.
    pub fn deserialize<'de, D: Deserializer<'de>, T: Deserialize<'de>, const N: usize>(
        from: D,
    ) -> Result<[T; N], D::Error> {
        let list = Vec::deserialize(from)?;
        list.try_into()
            .map_err(|list: Vec<T>| D::Error::invalid_length(list.len(), &"another number of them"))
    }
}

/// Implements [`Stateful`](crate::snapshot::Stateful) for a type, given its fields by kind.
///
/// - `state`: values, or stateful fields
/// - `lists`: a `Vec` of values that keeps its capacity
/// - `slots`: arrays or slices of fixed length
/// - `each`: stateful elements whose number is a setting
/// - `fixed`: settings and working memory, which are not saved
///
/// A type with an unlisted field does not compile.
#[macro_export]
macro_rules! stateful {
    ($type:ty {
        $(state: $($state:ident),+;)?
        $(lists: $($list:ident),+;)?
        $(slots: $($slots:ident),+;)?
        $(each: $($each:ident),+;)?
        $(fixed: $($fixed:ident),+;)?
    }) => {
        impl $crate::snapshot::Stateful for $type {
            fn save(&self, to: &mut $crate::snapshot::Saver) {
                let Self { $($($state,)+)? $($($list,)+)? $($($slots,)+)? $($($each,)+)? $($($fixed: _,)+)? } = self;
                $($($crate::snapshot::Stateful::save($state, to);)+)?
                $($(to.list($list);)+)?
                $($(to.list($slots);)+)?
                $($(to.each($each.iter());)+)?
            }

            fn restore(
                &mut self,
                from: &mut $crate::snapshot::Restorer<'_>,
            ) -> Result<(), $crate::snapshot::SnapshotError> {
                let Self { $($($state,)+)? $($($list,)+)? $($($slots,)+)? $($($each,)+)? $($($fixed: _,)+)? } = self;
                $($($crate::snapshot::Stateful::restore($state, from)?;)+)?
                $($(from.list($list)?;)+)?
                $($(from.slots($slots)?;)+)?
                $($(from.each($each.iter_mut())?;)+)?
                Ok(())
            }
        }
    };
}

pub use stateful;

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Debug, PartialEq)]
    struct Machine {
        name: &'static str,
        turned: f64,
        seen: Vec<u16>,
        places: [Option<u8>; 40],
    }

    stateful!(Machine { state: turned; lists: seen; slots: places; fixed: name; });

    fn machine(name: &'static str, seen: &[u16]) -> Machine {
        let mut room = Vec::with_capacity(8);
        room.extend_from_slice(seen);
        Machine { name, turned: f64::from_bits(0x7ff8_0000_dead_beef), seen: room, places: [Some(3); 40] }
    }

    fn saved(machine: &Machine) -> Vec<u8> {
        let mut saver = Saver::default();
        saver.part("machine");
        machine.save(&mut saver);
        saver.finish().unwrap()
    }

    #[test]
    fn state_is_restored_bit_for_bit_without_changing_settings() {
        let bytes = saved(&machine("a", &[1, 2, 3]));
        let mut other = machine("b", &[]);
        (other.turned, other.places) = (0.0, [None; 40]);
        let mut from = Restorer::new(&bytes);
        from.part("machine").unwrap();
        other.restore(&mut from).unwrap();
        assert!(from.is_empty());
        assert_eq!((other.name, &other.seen[..], other.seen.capacity()), ("b", &[1, 2, 3][..], 8));
        assert_eq!((other.turned.to_bits(), other.places), (0x7ff8_0000_dead_beef, [Some(3); 40]));
    }

    #[test]
    fn error_about_a_snapshot_of_another_vehicle_names_the_part() {
        let bytes = saved(&machine("a", &[1, 2, 3]));
        let mut from = Restorer::new(&bytes);
        from.part("machine").unwrap();
        from.value::<f64>().unwrap();
        let words = from.slots(&mut [0_u16; 2]).unwrap_err().to_string();
        insta::assert_snapshot!(words, @"restoring machine from a snapshot: 3 elements in place of 2; it is from another vehicle or version, or damaged");
        assert!(Restorer::new(&bytes).part("engine").is_err());
        for cut in 0..bytes.len() {
            let mut from = Restorer::new(&bytes[..cut]);
            assert!(
                from.part("machine").and_then(|()| machine("b", &[]).restore(&mut from)).is_err(),
                "{cut}"
            );
        }
    }
}
