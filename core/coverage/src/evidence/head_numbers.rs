//! Serialises a set of heads in evidence.
//!
//! The set becomes a list of numbers in text formats such as JSON, and bits in snapshots.

use serde::{Deserialize, Deserializer, Serialize, Serializer};

use headrace_sampling::head::HeadSet;

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde passes fields by reference")]
pub(super) fn serialize<S: Serializer>(heads: &HeadSet, serializer: S) -> Result<S::Ok, S::Error> {
    if serializer.is_human_readable() {
        serializer.collect_seq(heads.iter())
    } else {
        heads.serialize(serializer)
    }
}

pub(super) fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<HeadSet, D::Error> {
    if deserializer.is_human_readable() {
        Ok(Vec::<usize>::deserialize(deserializer)?.into_iter().fold(HeadSet::default(), HeadSet::with))
    } else {
        HeadSet::deserialize(deserializer)
    }
}
