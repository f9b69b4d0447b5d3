//! Followers of a dive requested on the command line.

use std::net::SocketAddr;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use headrace_geometry::time::MonoNs;
use headrace_monitor::console::ConsolePort;
use headrace_vehicle::VehicleConfig;

use crate::cli::Following;
use crate::failure::Failure;
use crate::mavlink_out::MavlinkOut;
use crate::service::Service;
use crate::tui::{Mode, Start, Tui};
use crate::watch::{Show, Watch};

/// Followers that the command line requests for a dive.
pub(crate) struct Followers {
    tui: bool,
    /// Address that receives MAVLink, and MAVLink system id of the vehicle.
    mavlink_out: Option<(String, u8)>,
    foxglove: Option<SocketAddr>,
}

/// Information about the dive that followers need.
pub(crate) struct Joining<'a> {
    vehicle: &'a VehicleConfig,
    mode: Mode,
    interrupted: Arc<AtomicBool>,
    first: Option<String>,
    console: Option<ConsolePort>,
    #[cfg_attr(not(feature = "foxglove"), expect(dead_code, reason = "only Foxglove shows a log's span"))]
    span: Option<(MonoNs, MonoNs)>,
}

impl<'a> Joining<'a> {
    /// Describes a vehicle's dive for its followers. The flag `interrupted` ends the dive.
    pub(crate) fn new(vehicle: &'a VehicleConfig, mode: Mode, interrupted: &Arc<AtomicBool>) -> Self {
        let interrupted = Arc::clone(interrupted);
        Self { vehicle, mode, interrupted, first: None, console: None, span: None }
    }

    /// Sets the port for the operator's commands; `None` for a replay, which accepts none.
    pub(crate) fn operated(self, console: Option<ConsolePort>) -> Self {
        Self { console, ..self }
    }

    /// Sets the first and the last time of a log.
    pub(crate) fn over(self, span: Option<(MonoNs, MonoNs)>) -> Self {
        Self { span, ..self }
    }

    /// Sets the line that is shown before anything else.
    pub(crate) fn saying(self, first: String) -> Self {
        Self { first: Some(first), ..self }
    }
}

impl Followers {
    /// Creates the requested followers. Call this function before signals are handled.
    ///
    /// Errors: a follower isn't available in this program or terminal.
    pub(crate) fn of(asked: &Following) -> Result<Self, Failure> {
        if asked.foxglove.is_some() && !cfg!(feature = "foxglove") {
            let why = "--foxglove: this program was built without it; cargo build --features foxglove";
            return Err(Failure::Usage(why.to_owned()));
        }
        if asked.tui {
            Tui::prepare()?;
        }
        let mavlink_out = asked.mavlink_out.clone().map(|to| (to, asked.mavlink_system));
        Ok(Self { tui: asked.tui, mavlink_out, foxglove: asked.foxglove })
    }

    /// Kind of display on stdout. It is `otherwise` if no follower uses the terminal.
    pub(crate) fn show(&self, otherwise: Show) -> Show {
        if self.tui { Show::Followers } else { otherwise }
    }

    /// Starts the followers, and adds them to `watch`.
    ///
    /// Errors: a follower can't be started.
    pub(crate) fn join(self, mut watch: Watch, joining: Joining<'_>) -> Result<Watch, Failure> {
        if matches!(joining.mode, Mode::Live)
            && let Some(service) = Service::start()?
        {
            watch = watch.followed_by(Box::new(service));
        }
        if let Some((to, system_id)) = &self.mavlink_out {
            watch = watch.followed_by(Box::new(MavlinkOut::start(to, *system_id)?));
        }
        if let Some(at) = self.foxglove {
            watch = foxglove(watch, at, &joining)?;
        }
        if self.tui {
            let Joining { vehicle, mode, interrupted, first, console, .. } = joining;
            let start = Start { vehicle: &vehicle.name, first, mode, interrupted, console };
            watch = watch.followed_by(Box::new(Tui::start(start)?));
        }
        Ok(watch)
    }
}

#[cfg(feature = "foxglove")]
fn foxglove(watch: Watch, at: SocketAddr, joining: &Joining<'_>) -> Result<Watch, Failure> {
    use crate::foxglove_live::{Controlled, Foxglove};
    let controlled = match (&joining.mode, joining.span) {
        (Mode::Replay(commands, speed), Some(span)) => Some(Controlled {
            commands: commands.clone(),
            span,
            speed: *speed,
            interrupted: Arc::clone(&joining.interrupted),
        }),
        _ => None,
    };
    let site = crate::dive::view_site(joining.vehicle);
    let is_live = matches!(joining.mode, Mode::Live);
    Ok(watch.followed_by(Box::new(Foxglove::start(at, &joining.vehicle.name, site, is_live, controlled)?)))
}

#[cfg(not(feature = "foxglove"))]
#[expect(clippy::unnecessary_wraps, reason = "with the feature it may fail")]
fn foxglove(watch: Watch, _: SocketAddr, _: &Joining<'_>) -> Result<Watch, Failure> {
    // If the program lacks the feature `foxglove`, the option has been refused earlier.
    Ok(watch)
}
