//! Smoothing over a whole dive: what was learnt later corrects the estimates before.
//!
//! While the filter runs it leaves a record of each step ([`step`], [`journal`]). Afterwards [`backward`] takes them the
//! other way round and makes a [`track`] of them, by which the dive is replayed once more. Derivation: `docs/fusion.md`,
//! "Smoothing".

pub mod backward;
pub mod journal;
pub mod relative_backward;
pub mod rts_step;
pub mod step;
pub mod track;

#[cfg(test)]
mod tests;
