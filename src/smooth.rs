//! `replay --smooth`: replays with the filter, smooths the trajectory, and replays along it.

use std::path::{Path, PathBuf};

use headrace_monitor::report::Report;
use headrace_replay::drive::Pace;
use headrace_replay::player::Player;
use headrace_replay::smooth::FirstPass;
use headrace_vehicle::NavigationConfig;
use headrace_vehicle::VehicleConfig;

use crate::dive::Assembly;
use crate::failure::Failure;
use crate::phase::Phase;
use crate::watch::Watch;

/// Report of a dive judged along its smoothed trajectory.
///
/// `player` plays the log from its beginning, which also shows the log's losses.
pub(crate) fn smoothed(
    files: &[PathBuf],
    player: &mut Player,
    (vehicle, text): (&VehicleConfig, &str),
    (pace, threads): (Pace, usize),
) -> Result<Report, Failure> {
    let NavigationConfig::Filter(settings) = vehicle.navigation else {
        return Err(Failure::Usage(format!(
            "replaying {}: --smooth needs [navigation] way = \"filter\"; the vehicle file has \
             way = \"direct\"",
            files.first().map_or(Path::new(""), PathBuf::as_path).display()
        )));
    };
    let (mut pass, filters) = FirstPass::new(vehicle, settings)?;
    let dive = Assembly::of(vehicle, text).navigated(filters).assemble()?;
    let mut first = Player::open(files)?;
    first.connect(dive.armed.sources());
    let forward = Phase::start("forward pass");
    let before = dive.run(&mut first, pace, &mut Watch::quiet(), &mut |dive| pass.after_tick(dive))?;
    drop(forward);
    let backward = Phase::start("backward pass");
    let (navigation, changes) = pass.smooth()?;
    drop(backward);
    let _judging = Phase::start("replay along the smoothed trajectory");
    let dive = Assembly::of(vehicle, text).navigated(navigation).assemble()?;
    player.connect(dive.armed.sources());
    let mut report = dive.run_on(threads, (player, pace), &mut Watch::quiet(), &mut |_| ())?;
    changes.complete(&before, &mut report);
    Ok(report)
}
