//! `replay` with several targets or section lengths: verdicts for each combination of them.

use std::path::PathBuf;

use headrace_geometry::time::DurNs;
use headrace_monitor::other_targets::OtherTargetReport;
use headrace_monitor::report::Report;
use headrace_replay::drive::Pace;
use headrace_replay::player::Player;
use headrace_vehicle::VehicleConfig;

use crate::cli::Replay;
use crate::dive::Assembly;
use crate::failure::Failure;
use crate::phase::Phase;
use crate::smooth;
use crate::watch::Watch;

/// Judges the dive for each combination of the requested targets and section lengths. Returns nothing if
/// there is only one combination.
///
/// The passes that count, and the times at which sections are flagged, depend on the target. Each combination is
/// therefore replayed, except the one that was played already.
pub(crate) fn reports(
    args: &Replay,
    files: &[PathBuf],
    (mut vehicle, text): (VehicleConfig, &str),
    played: &Report,
) -> Result<Vec<OtherTargetReport>, Failure> {
    let own = |asked: &[f64], own: f64| if asked.is_empty() { vec![own] } else { asked.to_vec() };
    let (targets_m, sections_m) =
        (own(&args.target, vehicle.target.max_hole_m), own(&args.section, vehicle.section_m));
    let mut all = Vec::new();
    if !is_asked(args) {
        return Ok(all);
    }
    let _phase = Phase::start("other targets and sections");
    for section_m in sections_m {
        for target_m in &targets_m {
            (vehicle.target.max_hole_m, vehicle.section_m) = (*target_m, section_m);
            let is_played = target_m.to_bits() == played.target_m.to_bits()
                && section_m.to_bits() == played.section_m.to_bits();
            all.push(if is_played {
                played.metres()
            } else {
                replayed(args, files, (&vehicle, text))?.metres()
            });
        }
    }
    Ok(all)
}

/// Whether several targets or several section lengths are requested.
pub(crate) fn is_asked(args: &Replay) -> bool {
    args.target.len() > 1 || args.section.len() > 1
}

fn replayed(
    args: &Replay,
    files: &[PathBuf],
    (vehicle, text): (&VehicleConfig, &str),
) -> Result<Report, Failure> {
    let pace = Pace { tick: DurNs::from_millis(i64::from(args.tick_ms)), speed: None };
    let (mut player, threads) = (Player::open(files)?, args.threads.of_replay());
    if args.smooth {
        return smooth::smoothed(files, &mut player, (vehicle, text), (pace, threads));
    }
    let dive = Assembly::of(vehicle, text).assemble()?;
    player.connect(dive.armed.sources());
    dive.run_on(threads, (&mut player, pace), &mut Watch::quiet(), &mut |_| ())
}
