//! The four charts of a plan, as SVG text.
//!
//! They show the spacing around the wall, the pattern on the wall, the sample spacing T against speed, and the
//! hours of a dive against T.

mod advised;
mod detail;
mod hours;
mod laid;
mod modes;
mod pattern;
mod perimeter;
mod shown;
mod speeds;
mod wall;

pub(crate) use hours::hours;
pub(crate) use pattern::pattern;
pub(crate) use perimeter::perimeter;
pub(crate) use shown::Shown;
pub(crate) use speeds::speeds;

#[cfg(test)]
mod tests;
