//! Reasons for which a decoder withholds a reading.

use serde::{Deserialize, Serialize};

/// Reason for which a reading is withheld.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum WithheldReason {
    /// The packet contains no message that carries readings of the device.
    NoMessage,
    /// The message is from a device with another id or address.
    OtherDevice,
    /// The device uses another range setting than the vehicle file.
    OtherRange,
    /// The device's calibration is unknown or invalid.
    NoCalibration,
    /// The device marks the value invalid.
    MarkedInvalid,
    /// The device reports a fault, or is busy.
    Fault,
    /// A value is outside the range that it can have.
    Implausible,
    /// The message repeats the last one.
    Repeated,
    /// The reading is older on arrival than the device's delay can be.
    Late {
        /// Age of the reading on arrival, seconds.
        age_s: f64,
        /// Largest age of a used reading, seconds.
        at_most_s: f64,
    },
}
