//! `headrace export`: a recorded dive as one page that opens from disk.

use std::path::PathBuf;

use headrace_dashboard::Mode;
use headrace_dashboard::export::Export as PageExport;
use headrace_monitor::report::Report;
use headrace_monitor::voice::Voice;
use headrace_replay::drive::{Pace, PacketSource as _};
use headrace_replay::log::files_of;
use headrace_replay::notes::each_voice;
use headrace_replay::player::Player;
use serde_json::json;

use crate::cli::Export;
use crate::dive::Assembly;
use crate::failure::Failure;
use crate::feeds::Interruptible;
use crate::files;
use crate::interrupt;
use crate::output::say;
use crate::outputs::{Claims, EXPORTED, Kind};
use crate::page::{self, Of, VoicesOf};
use crate::report_output::{exit_code, note_losses};
use crate::vehicle_file::Given;
use crate::watch::Watch;

/// Maximum total size of the voice notes' recordings in an exported page, bytes. It is enough for two hours.
const MOST_VOICE_BYTES: usize = 24 << 20;

/// Runs `headrace export`.
pub(crate) fn export(args: &Export) -> Result<u8, Failure> {
    let (files, log) = (files_of(&args.logs)?, files::first_named(&args.logs));
    let given = Given::read(args.vehicle.as_deref())?;
    let inputs = files.iter().chain(&given.files).cloned();
    Claims::reading(inputs, &args.overwrite).claim("--html", &args.html, Kind::Page)?;
    let mut player = Player::open(&files)?;
    let (text, vehicle) = given.or_attached(player.info(), &player.losses(), log)?;
    let dive = Assembly::of(&vehicle, &text).kept(true).assemble()?;
    player.connect(dive.armed.sources());
    let of = Of {
        vehicle: &vehicle,
        mode: Mode::File,
        dive: log.display().to_string(),
        recorded_to: None,
        compared_m: None,
        utc_of_zero_s: page::utc_of_zero_s(&player.info().metadata),
        span: player.span(),
        clock: player.dive_clock(),
        is_playback: false,
        console: None,
        voices: VoicesOf::Log(files.clone()),
    };
    let export = PageExport::start(page::site(of))?;
    let mut watch = Watch::quiet().followed_by(page::following(export.collector(&dive.armed)));
    let interrupted = interrupt::flag()?;
    let mut feed = Interruptible { feed: &mut player, interrupted: &interrupted };
    let mut report = dive.run(&mut feed, Pace::default(), &mut watch, &mut |_| ())?;
    drop(watch);
    note_losses(&mut report, log, &player);
    let (voices, left_out) = voices(&files, &report)?;
    let mut page = export.page(&json!(report.alert_list), &voices, &page::end_message(&report))?;
    page.extend_from_slice(EXPORTED.as_bytes());
    files::write(&args.html, &page)?;
    say(&format!("page   {} ({} kB)", args.html.display(), page.len() / 1000));
    if left_out > 0 {
        say(&format!(
            "{left_out} recordings of voice notes don't fit into the page; headrace notes --out writes them"
        ));
    }
    Ok(exit_code(&report))
}

/// Recordings of the dive's voice notes that fit into a page, and the number of recordings that don't fit.
fn voices(files: &[PathBuf], report: &Report) -> Result<(Vec<Voice>, u64), Failure> {
    let (mut voices, mut bytes, mut left_out): (Vec<Voice>, _, _) = (Vec::new(), 0, 0);
    // Without voice notes, as in most dives, the log needn't be read again.
    if report.notes.iter().any(|note| note.voice.is_some()) {
        each_voice(files, |voice| {
            // A voice note's recording may be in the log twice, because a page that gets no answer sends the recording
            // again.
            if voices.iter().any(|other| other.id == voice.id) {
                return Ok::<_, Failure>(());
            }
            if bytes + voice.audio.len() > MOST_VOICE_BYTES {
                left_out += 1;
            } else {
                bytes += voice.audio.len();
                voices.push(voice);
            }
            Ok(())
        })?;
    }
    Ok((voices, left_out))
}
