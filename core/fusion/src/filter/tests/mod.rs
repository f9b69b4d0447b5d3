//! The filter against numbers of 100 digits, against textbook forms, and on cases that break filters.

mod faults;
mod hard_cases;
mod jacobians;
mod noise;
mod oracle;
mod properties;
mod rig;
