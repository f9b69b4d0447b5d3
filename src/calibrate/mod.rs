//! `headrace calibrate`: replays a log and estimates values for the vehicle file.

mod words;

use std::cell::Cell;

use headrace_calibration::collect::{Window, collect};
use headrace_calibration::findings::Findings;
use headrace_calibration::table::Table;
use headrace_geometry::time::MonoNs;
use headrace_replay::drive::PacketSource as _;
use headrace_replay::log::files_of;
use headrace_replay::player::Player;

use crate::cli::Calibrate;
use crate::dive::assemble;
use crate::failure::{self, Failure};
use crate::feeds::{Followed, share};
use crate::output::{deliver, show};
use crate::progress::Progress;
use crate::vehicle_file::Given;

/// Estimates a vehicle file's values from a log.
pub(crate) fn calibrate(args: &Calibrate) -> Result<u8, Failure> {
    let mut player = Player::open(&files_of(std::slice::from_ref(&args.log))?)?;
    let given = Given::read(args.vehicle.as_deref())?;
    let (text, vehicle) = given.or_attached(player.info(), &player.losses(), &args.log)?;
    let dive = assemble(&vehicle, &text, None)?;
    player.connect(dive.armed.sources());
    let window = Window { from_s: args.from, to_s: args.to, at_surface_s: args.at_surface };
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
