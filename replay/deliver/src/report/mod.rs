//! The report for the owner of the plant.
