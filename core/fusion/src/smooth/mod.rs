//! Smoothing over a whole dive: later measurements correct earlier estimates.
//!
//! The filter records each step as it runs ([`step`], [`journal`]). After the dive, [`backward`] processes the steps in
//! reverse order and builds a [`track`]. A second replay takes its positions from the track. Derivation:
//! `docs/why/navigation.md`, "Smoothing".

pub mod backward;
pub mod journal;
pub mod relative_backward;
pub mod rts_step;
pub mod step;
pub mod track;
pub mod two_filters;

#[cfg(test)]
mod tests;
