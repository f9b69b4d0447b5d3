//! The commands `demo`, `run` and `replay`.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use crossbeam::channel::unbounded;
use headrace_config::Document;
use headrace_dashboard::Mode;
use headrace_devices::KINDS;
use headrace_geometry::time::{DiveClock, DurNs};
use headrace_replay::drive::{Pace, PacketSource as _};
use headrace_replay::log::files_of;
use headrace_replay::player::Player;
use headrace_replay::{SimulationFeed, simulation};
use headrace_simulator::Scene;
use headrace_vehicle::VehicleConfig;

use crate::cli::{Demo, Output, Replay, Run, Speed};
use crate::dive::{Assembly, Clock, Dive, Recording};
use crate::expect::{self, Golden};
use crate::failure::{self, Failure};
use crate::feeds::Interruptible;
use crate::files;
use crate::followers::{Followers, Joining};
use crate::interrupt;
use crate::keyboard;
use crate::live;
use crate::logging::complain;
use crate::other_targets;
use crate::output::{put_line, say, show};
use crate::outputs::{self, Claims, Kind};
use crate::page::{self, Of, Served, VoicesOf};
use crate::play::{self, Directors, Playing};
use crate::report_output::{exit_code, finish, note_losses, state_utc};
use crate::screen::Screen;
use crate::smooth;
use crate::summary::summary;
use crate::terminal;
use crate::tui;
use crate::vehicle_file::{self, Given};
use crate::watch::{Show, Watch};

/// Speed of the replay after a demo that ran as fast as possible, relative to real time. At the demo's own speed, the
/// replay would end before anyone could watch it.
const REPLAY_SPEED: f64 = 20.0;
/// Time after the last packet to which a jump to the log's end leads, so that the end is reached for certain.
const BEYOND_END: DurNs = DurNs(1_000_000_000);

/// Runs `headrace demo`.
pub(crate) fn demo(args: &Demo) -> Result<u8, Failure> {
    let (name, text) = files::DEMO_SCENE;
    let scene = Scene::parse(Document::new(name, text), &KINDS, &files::built_in, None)?;
    outputs::folder(&args.out)?;
    let (log, report_file) = (args.out.join("dive.mcap"), args.out.join("report.json"));
    let mut claims = Claims::reading(args.page.files(), &args.overwrite);
    claims.claim("--out", &log, Kind::Simulation)?;
    claims.claim("--out", &report_file, Kind::Report)?;
    // The recorder creates only new logs, so an earlier log is removed.
    outputs::make_way(&log)?;
    let followers = Followers::of(&args.following)?;
    let interrupted = interrupt::flag()?;
    let recording = Recording::simulated(&log, &scene.name);
    let is_served = page::is_wanted(&args.page, true);
    let is_replayed = is_served && !args.exit && keyboard::is_ours() && terminal::is_watched();
    let dive = Assembly::of(&scene.vehicle, &scene.vehicle_text)
        .recorded(Some(recording))
        .kept(is_served)
        .assemble()?
        .operated(Clock::Theirs);
    let shown = followers.show(Show::Lines);
    let mut watch = Watch::new(shown);
    if watch.shows_lines() {
        say(&format!(
            "{}, target {} m: a simulated dive",
            scene.vehicle.name, scene.vehicle.target.max_hole_m
        ));
    }
    let of = Of { is_playback: is_replayed, ..of_demo(&scene, &log, &dive) };
    let served = is_served.then(|| demo_page(args, of, watch.shows_lines())).flatten();
    if let Some(served) = &served {
        watch = watch.followed_by(served.follower(&dive.armed));
    }
    let joining = Joining::new(&scene.vehicle, tui::Mode::Demo, &interrupted).operated(dive.console());
    let mut watch = followers.join(watch, joining)?;
    let mut feed = SimulationFeed::new(simulation(&scene, false)?);
    let pace = Pace { speed: args.speed.0, ..Pace::default() };
    let mut feed = Interruptible { feed: &mut feed, interrupted: &interrupted };
    let report = dive.run(&mut feed, pace, &mut watch, &mut |_| ())?;
    let is_interrupted = interrupted.load(Ordering::Relaxed);
    if let Some(served) = &served {
        served.show_result(&report);
    }
    files::write_json(&report_file, &report)?;
    let ended = if is_interrupted { "interrupted: the dive so far\n" } else { "" };
    show(&format!("\n{ended}{}", summary(&report, Screen::columns())));
    say(&format!("report {}", report_file.display()));
    say(&format!("log    {}  (headrace replay)", log.display()));
    if let Some(served) = served.filter(|_| is_replayed && !is_interrupted)
        && let Err(error) = replay_demo(args, &scene, &served, &interrupted)
    {
        // The dive itself was complete, so a replay that fails doesn't change the exit code.
        complain(&format!("headrace: the page can't replay {}: {error}", log.display()));
    }
    Ok(exit_code(&report))
}

/// Replays the recorded demo on its page, beginning at the end of the dive, until a key or a signal ends it.
fn replay_demo(
    args: &Demo,
    scene: &Scene,
    served: &Served,
    interrupted: &Arc<AtomicBool>,
) -> Result<(), Failure> {
    let mut player = Player::open(&files_of(&[args.out.join("dive.mcap")])?)?;
    let span = player.span();
    let dive = Assembly::of(&scene.vehicle, &scene.vehicle_text).kept(true).assemble()?;
    player.connect(dive.armed.sources());
    let mut watch = Watch::quiet().followed_by(served.replay_follower(&dive.armed, &player));
    let (sender, commands) = unbounded();
    let close = served.direct((&sender, player.dive_clock()), true, Arc::clone(interrupted));
    say("The page now replays the dive, with pause, seek and speed. Press q to end.");
    let playing = Playing {
        from: span.map(|(_, to)| player.dive_clock().time(to) + BEYOND_END),
        interactive: true,
        pace: Pace { speed: args.speed.0.or(Some(REPLAY_SPEED)), ..Pace::default() },
        commands: (sender, commands),
        others: Some(Directors { takes_keys: false, close }),
    };
    // The result of the replay is dropped, because the page has already shown the dive's result.
    playing.play(dive, &mut player, &mut watch).map(drop)
}

/// Data for the page of a demo.
fn of_demo<'a>(scene: &'a Scene, log: &Path, dive: &Dive) -> Of<'a> {
    Of {
        vehicle: &scene.vehicle,
        mode: Mode::Demo,
        dive: scene.name.clone(),
        recorded_to: Some(log.display().to_string()),
        compared_m: None,
        utc_of_zero_s: None,
        span: None,
        clock: DiveClock::default(),
        is_playback: false,
        console: dive.console(),
        voices: VoicesOf::Dive(dive.voice_ports()),
    }
}

/// Serves the page of a demo, and opens a browser that shows it.
fn demo_page(args: &Demo, of: Of<'_>, in_lines: bool) -> Option<Served> {
    let served = page::serve(&args.page, of, in_lines.then_some(&mut put_line))?;
    if !args.no_open {
        served.open();
    }
    Some(served)
}

/// Runs `headrace run`.
pub(crate) fn run(args: &Run) -> Result<u8, Failure> {
    let (text, vehicle) = vehicle_file::read(&args.vehicle)?;
    let mut inputs = vehicle_file::files(&args.vehicle, &vehicle);
    inputs.extend(files_of(args.source.as_slice())?);
    inputs.extend(args.page.files());
    let mut claims = Claims::reading(inputs, &args.output.overwrite);
    claim_report(&args.output, &mut claims)?;
    let Some(log) = &args.source else { return live::run(args, &text, &vehicle, claims) };
    let mut player = Player::open(&files_of(std::slice::from_ref(log))?)?;
    live::make_room(&args.record, args, claims)?;
    let rotate = args.rotate;
    let paths = args.record.as_slice();
    let recording = (!paths.is_empty()).then_some(Recording {
        paths,
        clock: Clock::Theirs,
        rotate,
        scene: None,
        earlier: &[],
    });
    if let (None, Some(_)) = (&recording, args.rotate) {
        return Err(Failure::Usage(
            "run: --rotate needs a recording; with --source, add --record".to_owned(),
        ));
    }
    let is_served = page::is_wanted(&args.page, args.speed.0.is_some());
    let dive = Assembly::of(&vehicle, &text).recorded(recording).kept(is_served).assemble()?;
    player.connect(dive.armed.sources());
    let pace = Pace { speed: args.speed.0, ..Pace::default() };
    let followers = Followers::of(&args.following)?;
    let interrupted = interrupt::flag()?;
    let mut watch = Watch::new(followers.show(args.output.show()));
    let of = Of {
        vehicle: &vehicle,
        mode: Mode::Replay,
        dive: log.display().to_string(),
        recorded_to: paths.first().map(|path| path.display().to_string()),
        compared_m: None,
        utc_of_zero_s: None,
        span: player.span(),
        clock: player.dive_clock(),
        is_playback: false,
        console: None,
        voices: VoicesOf::Log(files_of_player(&player)),
    };
    let served = if is_served {
        page::serve(&args.page, of, watch.shows_lines().then_some(&mut put_line))
    } else {
        None
    };
    if let Some(served) = &served {
        watch = watch.followed_by(served.follower(&dive.armed));
    }
    let mut feed = Interruptible { feed: &mut player, interrupted: &interrupted };
    let mut watch = followers.join(watch, Joining::new(&vehicle, tui::Mode::Source, &interrupted))?;
    let mut report = dive.run(&mut feed, pace, &mut watch, &mut |_| ())?;
    note_losses(&mut report, log, &player);
    state_utc(&mut report, page::utc_of_zero_s(&player.info().metadata));
    if let Some(served) = served {
        served.end(&report);
    }
    finish(&report, &args.output)
}

/// Runs `headrace replay`.
pub(crate) fn replay(args: &Replay) -> Result<u8, Failure> {
    let (files, log) = (files_of(&args.logs)?, files::first_named(&args.logs));
    let given = Given::read(args.vehicle.as_deref())?;
    claim_of_replay(args, &files, &given)?;
    let golden = args.expect.as_deref().filter(|_| !args.bless).map(Golden::read).transpose()?;
    let mut player = Player::open(&files)?;
    let (text, mut vehicle) = given.or_attached(player.info(), &player.losses(), log)?;
    set(args, &mut vehicle);
    let has_keys = args.following.may_command() || args.interactive && play::has_keys();
    let usual = Speed(if has_keys { Some(1.0) } else { None });
    let pace =
        Pace { tick: DurNs::from_millis(i64::from(args.tick_ms)), speed: args.speed.unwrap_or(usual).0 };
    let mut served = None;
    let mut report = if args.smooth {
        smooth::smoothed(&files, &mut player, (&vehicle, &text), (pace, args.threads.of_replay()))?
    } else {
        let is_watched = pace.speed.is_some() && !terminal::is_quiet();
        let is_served = page::is_wanted(&args.page, is_watched);
        let dive = Assembly::of(&vehicle, &text).kept(is_served).assemble()?;
        player.connect(dive.armed.sources());
        let (sender, commands) = unbounded();
        let followers = Followers::of(&args.following)?;
        let mut watch = Watch::new(followers.show(args.output.show()));
        served = is_served.then(|| replay_page(args, &vehicle, log, &player, watch.shows_lines())).flatten();
        let mut close = None;
        if let Some(served) = &served {
            watch = watch.followed_by(served.follower(&dive.armed));
            let stays = args.page.page.is_some();
            let interrupted = if stays { interrupt::flag()? } else { Arc::default() };
            close = served.direct((&sender, player.dive_clock()), stays, interrupted);
        }
        let takes_keys = args.following.may_command();
        let mut joining = Joining::new(&vehicle, tui::Mode::Source, &Arc::default());
        if takes_keys {
            let mode = tui::Mode::Replay(sender.clone(), pace.speed);
            joining = Joining::new(&vehicle, mode, &interrupt::flag()?).over(player.span());
        }
        let mut watch = followers.join(watch, joining)?;
        if args.from.is_some() || args.interactive || served.is_some() || takes_keys {
            let others = (served.is_some() || takes_keys).then_some(Directors { takes_keys, close });
            let playing = Playing {
                from: args.from,
                interactive: args.interactive,
                pace,
                commands: (sender, commands),
                others,
            };
            playing.play(dive, &mut player, &mut watch)?
        } else {
            dive.run_on(args.threads.of_replay(), (&mut player, pace), &mut watch, &mut |_| ())?
        }
    };
    if let Some(served) = served {
        served.end(&report);
    }
    note_losses(&mut report, log, &player);
    state_utc(&mut report, page::utc_of_zero_s(&player.info().metadata));
    if player.coming()?.is_none() {
        report.other_targets = other_targets::reports(args, &files, (vehicle, &text), &report)?;
    } else if other_targets::is_asked(args) {
        tracing::warn!(
            "other targets and sections aren't evaluated: the replay was stopped before the end of the log"
        );
    }
    let code = finish(&report, &args.output)?;
    if let Some(path) = args.expect.as_deref().filter(|_| args.bless) {
        expect::bless(&report, path)?;
    }
    let differs = golden.map_or(Ok(false), |golden| golden.differs(&report))?;
    Ok(if differs { failure::FAILED } else { code })
}

/// Files that the replay reads.
fn files_of_player(player: &Player) -> Vec<PathBuf> {
    player.files().iter().map(|file| file.path.clone()).collect()
}

/// Serves the page of a replay.
fn replay_page(
    args: &Replay,
    vehicle: &VehicleConfig,
    log: &Path,
    player: &Player,
    in_lines: bool,
) -> Option<Served> {
    let of = Of {
        vehicle,
        mode: Mode::Replay,
        dive: log.display().to_string(),
        recorded_to: None,
        compared_m: args.target.get(1).copied(),
        utc_of_zero_s: page::utc_of_zero_s(&player.info().metadata),
        span: player.span(),
        clock: player.dive_clock(),
        is_playback: true,
        console: None,
        voices: VoicesOf::Log(files_of_player(player)),
    };
    page::serve(&args.page, of, in_lines.then_some(&mut put_line))
}

/// Checks that the report can be written.
fn claim_report(output: &Output, claims: &mut Claims) -> Result<(), Failure> {
    output.report.as_ref().map_or(Ok(()), |report| claims.claim("--report", report, Kind::Report))
}

/// Checks that a replay's outputs can be written. The golden report (the report to compare with) is an input, or with
/// --bless an output.
fn claim_of_replay(args: &Replay, logs: &[PathBuf], given: &Given) -> Result<(), Failure> {
    let read = args.expect.iter().filter(|_| !args.bless);
    let inputs = logs.iter().chain(&given.files).chain(read).cloned().chain(args.page.files());
    let mut claims = Claims::reading(inputs, &args.output.overwrite);
    claim_report(&args.output, &mut claims)?;
    let blessed = args.expect.as_ref().filter(|_| args.bless);
    blessed.map_or(Ok(()), |golden| claims.claim("--expect", golden, Kind::Report))
}

/// Overrides settings of the vehicle file by the options. If the options give several targets or section lengths, the
/// dive itself uses the first. The module `other_targets` judges the others.
fn set(args: &Replay, vehicle: &mut VehicleConfig) {
    vehicle.target.max_hole_m = args.target.first().copied().unwrap_or(vehicle.target.max_hole_m);
    vehicle.section_m = args.section.first().copied().unwrap_or(vehicle.section_m);
    vehicle.site.sound_speed_mps = args.sound_speed.unwrap_or(vehicle.site.sound_speed_mps);
}
