//! The commands `demo`, `run`, `replay` and `check`.

use headrace_config::Document;
use headrace_geometry::time::DurNs;
use headrace_replay::drive::Pace;
use headrace_replay::log::files_of;
use headrace_replay::player::Player;
use headrace_replay::{SimulationFeed, simulation};
use headrace_simulator::Scene;
use headrace_vehicle::VehicleConfig;
use serde_json::json;

use crate::cli::{Check, Demo, Replay, Run};
use crate::devices::KINDS;
use crate::dive::{Clock, Recording, WhatIf, assemble};
use crate::expect;
use crate::failure::{self, Failure};
use crate::files;
use crate::live;
use crate::output::{deliver, put, say};
use crate::play::Playing;
use crate::report_output::{exit_code, finish, note_losses};
use crate::screen::Screen;
use crate::smooth;
use crate::summary::summary;
use crate::vehicle_file;
use crate::watch::{Show, Watch};

/// `headrace demo`.
pub(crate) fn demo(args: &Demo) -> Result<u8, Failure> {
    let (name, text) = files::DEMO_SCENE;
    let scene = Scene::parse(Document::new(name, text), &KINDS, &files::built_in, None)?;
    std::fs::create_dir_all(&args.out).map_err(|source| Failure::Write { path: args.out.clone(), source })?;
    let (log, report_file) = (args.out.join("dive.mcap"), args.out.join("report.json"));
    // The recorder never overwrites a log; the last demonstration's may be removed.
    if log.exists() {
        std::fs::remove_file(&log).map_err(|source| Failure::Write { path: log.clone(), source })?;
    }
    let dive = assemble(&scene.vehicle, &scene.vehicle_text, Some(Recording::whole(&log, Clock::Theirs)))?;
    say(&format!("{}, target {} m: a simulated dive", scene.vehicle.name, scene.vehicle.target_m));
    let mut feed = SimulationFeed::new(simulation(&scene, false)?);
    let pace = Pace { speed: args.speed.0, ..Pace::default() };
    let report = dive.run(&mut feed, pace, &mut Watch::new(Show::Lines))?;
    files::write_json(&report_file, &report)?;
    put(&format!("\n{}", summary(&report, Screen::columns())));
    say(&format!("report {}\nlog    {}  (headrace replay)", report_file.display(), log.display()));
    Ok(exit_code(&report))
}

/// `headrace run`.
pub(crate) fn run(args: &Run) -> Result<u8, Failure> {
    let (text, vehicle) = vehicle_file::read(&args.vehicle)?;
    let Some(log) = &args.source else { return live::run(args, &text, &vehicle) };
    let mut player = Player::open(&files_of(std::slice::from_ref(log))?)?;
    let recording =
        args.record.as_deref().map(|path| Recording { path, clock: Clock::Theirs, rotate: args.rotate });
    if let (None, Some(_)) = (&recording, args.rotate) {
        return Err(Failure::Usage(
            "run: --rotate needs a recording; with --source, add --record".to_owned(),
        ));
    }
    let dive = assemble(&vehicle, &text, recording)?;
    player.connect(dive.armed.sources());
    let pace = Pace { speed: args.speed.0, ..Pace::default() };
    let mut report = dive.run(&mut player, pace, &mut Watch::new(args.output.show()))?;
    note_losses(&mut report, log, &player)?;
    finish(&report, &args.output)
}

/// `headrace replay`.
pub(crate) fn replay(args: &Replay) -> Result<u8, Failure> {
    let (files, log) = (files_of(&args.logs)?, files::first_named(&args.logs));
    let mut player = Player::open(&files)?;
    let (text, mut vehicle) = match &args.vehicle {
        Some(path) => vehicle_file::read(path),
        None => vehicle_file::attached(player.info(), &player.losses(), log),
    }?;
    let what_if = what_if(args, &mut vehicle);
    let pace = Pace { tick: DurNs::from_millis(i64::from(args.tick_ms)), speed: args.speed.0 };
    let mut report = if args.smooth {
        smooth::smoothed(&files, &mut player, (&vehicle, &text), pace, what_if)?
    } else {
        let dive = assemble(&vehicle, &text, None)?.asking(what_if);
        player.connect(dive.armed.sources());
        let mut watch = Watch::new(args.output.show());
        if args.from.is_some() || args.interactive {
            let playing = Playing { from: args.from, interactive: args.interactive, pace };
            playing.play(dive, &mut player, &mut watch)?
        } else {
            dive.run(&mut player, pace, &mut watch)?
        }
    };
    note_losses(&mut report, log, &player)?;
    let code = finish(&report, &args.output)?;
    match &args.expect {
        Some(golden) if args.bless => expect::bless(&report, golden).map(|()| code),
        Some(golden) if expect::differs(&report, golden)? => Ok(failure::FAILED),
        _ => Ok(code),
    }
}

/// Overrides the vehicle's settings by the options. Of several targets and section lengths the first is the dive's own; all are
/// returned for evaluation as alternatives.
fn what_if(args: &Replay, vehicle: &mut VehicleConfig) -> WhatIf {
    vehicle.target_m = args.target.first().copied().unwrap_or(vehicle.target_m);
    vehicle.section_m = args.section.first().copied().unwrap_or(vehicle.section_m);
    vehicle.site.sound_speed_mps = args.sound_speed.unwrap_or(vehicle.site.sound_speed_mps);
    if args.target.len() < 2 && args.section.len() < 2 {
        return WhatIf::default();
    }
    let or = |asked: &[f64], own: f64| if asked.is_empty() { vec![own] } else { asked.to_vec() };
    WhatIf { targets_m: or(&args.target, vehicle.target_m), sections_m: or(&args.section, vehicle.section_m) }
}

/// `headrace check`.
pub(crate) fn check(args: &Check) -> Result<u8, Failure> {
    let (_, vehicle) = vehicle_file::read(&args.vehicle)?;
    let sensors = vehicle.sensor_configs.iter();
    if args.json {
        let list: Vec<_> =
            sensors.map(|s| json!({"id": s.id, "plugin": s.plugin, "connect": s.connect})).collect();
        let shown = json!({
            "vehicle": vehicle.name, "target_m": vehicle.target_m, "section_m": vehicle.section_m,
            "tunnel": vehicle.tunnel.name, "perimeter_m": vehicle.tunnel.profile.perimeter_m(),
            "length_m": vehicle.tunnel.length_m, "sensors": list,
        });
        deliver(&shown.to_string())?;
    } else {
        say(&format!("{}: target {} m, sections of {} m", vehicle.name, vehicle.target_m, vehicle.section_m));
        say(&format!(
            "tunnel {}: perimeter {:.2} m, length {} m",
            vehicle.tunnel.name,
            vehicle.tunnel.profile.perimeter_m(),
            vehicle.tunnel.length_m
        ));
        for sensor in sensors {
            say(&format!("  {:<12} {:<12} {}", sensor.id, sensor.plugin, sensor.connect));
        }
    }
    let wrong =
        live::connections(&vehicle).into_iter().filter_map(|(id, connect)| Some((id, connect.err()?)));
    // A vehicle that is only simulated or replayed needs no ports.
    let wrong: Vec<_> = wrong.filter(|(_, error)| !error.text.is_empty()).collect();
    for (id, error) in &wrong {
        eprintln!("headrace: sensor {id:?}: {error}");
    }
    if !wrong.is_empty() {
        return Ok(failure::USAGE);
    }
    if !args.json {
        say("no errors");
    }
    Ok(failure::OK)
}
