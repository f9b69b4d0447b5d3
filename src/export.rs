//! `headrace export`: a recorded dive as one page that opens from disk.

use headrace_dashboard::Mode;
use headrace_dashboard::export::Export as PageExport;
use headrace_replay::drive::{Pace, PacketSource as _};
use headrace_replay::log::files_of;
use headrace_replay::player::Player;
use serde_json::json;

use crate::cli::Export;
use crate::dive::assemble_followed;
use crate::failure::Failure;
use crate::feeds::Interruptible;
use crate::files;
use crate::interrupt;
use crate::output::say;
use crate::outputs::{self, EXPORTED, Kind};
use crate::page::{self, Of};
use crate::report_output::{exit_code, note_losses};
use crate::vehicle_file;
use crate::watch::Watch;

/// `headrace export`.
pub(crate) fn export(args: &Export) -> Result<u8, Failure> {
    let (files, log) = (files_of(&args.logs)?, files::first_named(&args.logs));
    outputs::is_no_input(&args.html, &files)?;
    outputs::claim(&args.html, Kind::Page, &args.overwrite)?;
    let mut player = Player::open(&files)?;
    let (text, vehicle) = match &args.vehicle {
        Some(path) => vehicle_file::read(path),
        None => vehicle_file::attached(player.info(), &player.losses(), log),
    }?;
    let dive = assemble_followed(&vehicle, &text, None, true)?;
    player.connect(dive.armed.sources());
    let of = Of {
        vehicle: &vehicle,
        mode: Mode::File,
        dive: log.display().to_string(),
        recorded_to: None,
        compared_m: None,
        utc_of_zero_s: page::utc_of_zero_s(&player.info().metadata),
        span: player.span(),
        is_playback: false,
        console: None,
    };
    let export = PageExport::start(page::site(of))?;
    let mut watch = Watch::quiet().followed_by(page::following(export.collector(&dive.armed)));
    let interrupted = interrupt::flag()?;
    let mut feed = Interruptible { feed: &mut player, interrupted: &interrupted };
    let mut report = dive.run(&mut feed, Pace::default(), &mut watch)?;
    drop(watch);
    note_losses(&mut report, log, &player);
    let mut page = export.page(&json!(report.alert_list), &page::end_message(&report))?;
    page.extend_from_slice(EXPORTED.as_bytes());
    files::write(&args.html, &page)?;
    say(&format!("page   {} ({} kB)", args.html.display(), page.len() / 1000));
    Ok(exit_code(&report))
}
