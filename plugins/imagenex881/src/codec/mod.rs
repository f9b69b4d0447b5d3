//! Wire format of the 881 family: 27-byte switch commands to the head, returns of 13 to 513 bytes from it.

mod command;
mod returns;

pub use command::{COMMAND_BYTES, Command, CommandCodec, CommandError, Commands, Points, RANGES_M};
pub(crate) use command::{step_at_most, step_deg};
pub use returns::{
    Header, MAX_ECHO_BYTES, MAX_POSITION, MAX_RETURN_BYTES, Model, Return, ReturnCodec, ReturnError, Returns,
    Status, Tag,
};

/// Counts of 0.3 degrees in a full turn of a head.
pub const COUNTS_PER_TURN: i32 = 1200;

/// Position count at 0 degrees. Source: Imagenex 881A serial interface, head position.
pub const ZERO_COUNT: i32 = 600;

/// Speed of sound that the family assumes for every range, m/s. Source: Imagenex 881A serial interface, profile range.
pub const SOUND_SPEED_MPS: f64 = 1500.0;
