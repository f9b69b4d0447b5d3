//! Interface through which lines reach the machine's clock and ports. Tests can replace it.

use headrace_geometry::time::MonoNs;
use headrace_sensor::connect::Connect;

use crate::clock;
use crate::lines::{self, Line};
use crate::open_error::OpenError;

/// A machine's clock and its ports.
pub trait Host: Send + Sync {
    /// Returns the current time on the monotonic clock.
    fn now(&self) -> MonoNs;

    /// Opens the port or connection that a `connect` names.
    ///
    /// Errors: the cause, with its fix.
    fn open(&self, connect: &Connect) -> Result<Box<dyn Line>, OpenError>;
}

/// The machine on which this program runs.
pub(crate) struct RealHost;

impl Host for RealHost {
    fn now(&self) -> MonoNs {
        clock::now()
    }

    fn open(&self, connect: &Connect) -> Result<Box<dyn Line>, OpenError> {
        lines::open(connect)
    }
}
