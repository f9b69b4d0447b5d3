//! Plan for the rest of the dive: missed stretches and tunnel ahead, in the order that takes the least time.
//!
//! If the remaining time is too short, the plan covers as much wall as possible. The dive ends at the portal.

pub(crate) mod missed;
pub(crate) mod planner;
pub mod route;
pub(crate) mod selection;
pub mod texts;
