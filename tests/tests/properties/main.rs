//! Properties of random cases, with an adjustable number of cases:
//!
//!     HEADRACE_PROPERTY_CASES=10000000 cargo test -p headrace_tests --test properties -- --ignored --nocapture
//!     HEADRACE_PROPERTY_SEED=42 HEADRACE_PROPERTY_CASES=1000000 cargo test -p headrace_tests --test properties holes -- --ignored --nocapture
//!
//! The cases are divided among the five subjects, and the seed is printed with the number of cases. Case n of a seed is
//! the same as case 0 of the seed plus n. Ordinary tests run a few thousand cases of each subject, which are the same
//! in every run.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a failed step ends the test")]

mod cases;
mod codecs;
mod filter;
mod geometry;
mod holes;
mod sampling;
