//! The filter against numbers of 100 digits, against textbook forms, and on cases that break filters.

mod jacobians;
mod noise;
mod oracle;
