//! `headrace calibrate`: replays a log and estimates sensors' mounts, zeros and latencies for the vehicle
//! file.
//!
//! [`mod@collect`] runs a log through the loop and keeps its readings. Estimators process the readings after the dive.
//! They allocate memory, so the loop doesn't use them. If a log is insufficient, an estimator returns the reason.
//! Derivation: `docs/how-to/calibrate.md`.

pub(crate) mod collect;
mod estimate;
mod findings;
mod fit;
mod heads;
mod scan;
mod still;
mod sweep;
mod table;
#[cfg(test)]
mod tests;
mod timing;
mod words;
mod zero;

use std::cell::Cell;

use crate::calibrate::collect::{Window, collect};
use crate::calibrate::findings::Findings;
use crate::calibrate::table::Table;
use headrace_geometry::time::MonoNs;
use headrace_replay::drive::PacketSource as _;
use headrace_replay::log::files_of;
use headrace_replay::player::Player;
use headrace_vehicle::VehicleConfig;

use crate::cli::Calibrate;
use crate::dive::Assembly;
use crate::failure::{self, Failure};
use crate::feeds::{Followed, share};
use crate::output::{deliver, show};
use crate::progress::Progress;
use crate::vehicle_file::Given;

/// Runs `headrace calibrate`: estimates a vehicle file's values from a log.
pub(crate) fn calibrate(args: &Calibrate) -> Result<u8, Failure> {
    let mut player = Player::open(&files_of(std::slice::from_ref(&args.log))?)?;
    let given = Given::read(args.vehicle.as_deref())?;
    let (text, vehicle) = given.or_attached(player.info(), &player.losses(), &args.log)?;
    check(args, &vehicle, &player)?;
    let dive = Assembly::of(&vehicle, &text).assemble()?;
    player.connect(dive.armed.sources());
    let clock = player.dive_clock();
    let window = Window { from_s: args.from, to_s: args.to, at_surface_s: args.at_surface, clock };
    let mut progress = Progress::start();
    let (span, at) = (player.span(), Cell::new(MonoNs(0)));
    let mut feed = Followed { feed: &mut player, at: &at };
    let collected = collect(dive.armed, &mut feed, &window, &mut |readings| {
        progress.at(|| (format!("{readings} readings"), share(span, at.get())));
    })?;
    drop(progress);
    let mut progress = Progress::start();
    let findings = Findings::of(&vehicle, &collected, args.chainage, &mut |step| progress.step(step));
    drop(progress);
    let table = Table::of(&vehicle, &findings);
    let losses = player.losses();
    if args.json {
        let shown = words::json(args, &vehicle, &collected, &findings, &table, &losses);
        deliver(&serde_json::to_string_pretty(&shown)?)?;
    } else {
        show(&words::text(args, &vehicle, &collected, &findings, &table, &losses));
    }
    Ok(if !losses.is_empty() {
        failure::DATA_LOST
    } else if table.found.is_empty() {
        failure::FAILED
    } else {
        failure::OK
    })
}

/// Checks that the options fit the log.
///
/// Errors: the chainage isn't in the tunnel, or the window isn't in the log.
fn check(args: &Calibrate, vehicle: &VehicleConfig, player: &Player) -> Result<(), Failure> {
    let length_m = vehicle.tunnel.length_m;
    if let Some(chainage_m) = args.chainage.filter(|chainage_m| !(0.0..=length_m).contains(chainage_m)) {
        return Err(Failure::Usage(format!(
            "calibrating by {}: --chainage {chainage_m} is not in the tunnel, which is {length_m} m long",
            args.log.display()
        )));
    }
    let lasts_s = player.span().map_or(0.0, |(_, last)| player.dive_clock().seconds(last));
    if args.from > lasts_s {
        return Err(Failure::Usage(format!(
            "calibrating by {}: --from {} is after the log's end, at {lasts_s:.1} s",
            args.log.display(),
            args.from
        )));
    }
    Ok(())
}
