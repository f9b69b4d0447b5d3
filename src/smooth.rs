//! `replay --smooth`: a replay with the filter, smoothing, and a replay along the smoothed trajectory.

use std::path::{Path, PathBuf};

use headrace_fusion::filter::sources::Consistency;
use headrace_fusion::smooth::beside::BesideNavigation;
use headrace_fusion::smooth::journal::Journal;
use headrace_fusion::smooth::track::TrackNavigation;
use headrace_monitor::report::Report;
use headrace_monitor::report::smoothing_changes;
use headrace_monitor::run::Loop;
use headrace_replay::drive::Pace;
use headrace_replay::player::Player;
use headrace_replay::smooth::Steps;
use headrace_sensor::reading::MAX_SOURCES;
use headrace_vehicle::NavigationConfig;
use headrace_vehicle::VehicleConfig;

use crate::dive::{WhatIf, assemble_with};
use crate::failure::Failure;
use crate::phase::Phase;
use crate::watch::Watch;

/// Capacity of the queue of filter steps: a tick has a minute at most, with ten epochs a second and up to three steps each.
const RECORDS: usize = 4096;

/// The report of a dive judged along its smoothed trajectory. `player` plays the log from its beginning, for its losses.
pub(crate) fn smoothed(
    files: &[PathBuf],
    player: &mut Player,
    (vehicle, text): (&VehicleConfig, &str),
    (pace, threads): (Pace, usize),
    what_if: WhatIf,
) -> Result<Report, Failure> {
    let NavigationConfig::Filter(settings) = vehicle.navigation else {
        return Err(Failure::Usage(format!(
            "replaying {}: --smooth needs [navigation] way = \"filter\"; the vehicle file has \
             way = \"direct\"",
            files.first().map_or(Path::new(""), PathBuf::as_path).display()
        )));
    };
    let (journal, reader) = Journal::new(RECORDS);
    let mut steps = Steps::new(reader.clone())?;
    let profile = vehicle.tunnel.profile.clone();
    let filters = BesideNavigation::new(profile, vehicle.site, settings, journal);
    let dive = assemble_with(vehicle, Box::new(filters), text, None)?;
    let mut first = Player::open(files)?;
    first.connect(dive.armed.sources());
    let mut consistency = [None; MAX_SOURCES];
    let forward = Phase::start("forward pass");
    let before = dive.run_beside(&mut first, pace, &mut Watch::quiet(), &mut |dive| {
        steps.take();
        consistency = consistencies(dive);
    })?;
    drop(forward);
    let backward = Phase::start("backward pass");
    let records = steps.records();
    let track = steps.smooth(settings)?;
    tracing::debug!(records, pieces = track.pieces(), dropped = reader.dropped(), "smoothed");
    drop(backward);
    let _judging = Phase::start("replay along the smoothed trajectory");
    let (estimates, pieces) = (track.len() as u64, track.pieces() as u64);
    let dive = assemble_with(vehicle, Box::new(TrackNavigation::new(track, consistency)), text, None)?
        .asking(what_if);
    player.connect(dive.armed.sources());
    let mut report = dive.run_on(threads, (player, pace), &mut Watch::quiet(), &mut |_| ())?;
    report.smoothing = Some(smoothing_changes::compare(&before, &report, estimates, pieces));
    Ok(report)
}

fn consistencies(dive: &Loop) -> [Option<Consistency>; MAX_SOURCES] {
    core::array::from_fn(|source| dive.consistency(source))
}
