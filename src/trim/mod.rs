//! `headrace trim`: extracts part of a log.

mod anonymous;

use std::io::Write as _;
use std::path::PathBuf;

use headrace_geometry::time::{DiveClock, DurNs, MonoNs};
use headrace_monitor::console::{CONSOLE_ID, Command};
use headrace_replay::atomic_file::AtomicFile;
use headrace_replay::clocks::clock_of;
use headrace_replay::drive::Pace;
use headrace_replay::log::{
    DiveLog, LogHeader, LogInfo, Trim as Work, Trimmed, files_digest, files_of, trim as rewrite,
};
use headrace_replay::player::{Player, seconds};
use headrace_replay::record::result_channels;
use headrace_sensor::device::OptionalPayload;
use headrace_vehicle::VehicleConfig;
use serde_json::json;

use crate::cli::Trim;
use crate::dive::Assembly;
use crate::failure::{self, Failure};
use crate::files;
use crate::output::{deliver, say};
use crate::outputs::{Claims, Kind};
use crate::progress::Writing;
use crate::vehicle_file::Given;
use crate::watch::Watch;
use anonymous::Anonymous;

/// Tick length of the replay that finds the vehicle's chainage over time.
const TICK: DurNs = DurNs::from_millis(20);
/// Longest gap that the trimmed log keeps. During a gap the vehicle is outside the range of chainage, or has
/// no fix.
const BRIDGED: DurNs = DurNs::from_millis(2000);

/// Runs `headrace trim`.
pub(crate) fn trim(args: &Trim) -> Result<u8, Failure> {
    let files = files_of(&args.logs)?;
    let given = Given::read(args.vehicle.as_deref().filter(|_| needs_vehicle(args)))?;
    let inputs = files.iter().chain(&given.files).chain(&args.vehicle).cloned();
    Claims::reading(inputs, &args.overwrite).claim("-o", &args.output, Kind::Trimmed)?;
    let log = DiveLog::open(&files)?;
    let info = log.header().clone();
    let vehicle = vehicle(args, given, &files, &info)?;
    let clock = clock_of(&files)?;
    let spans = spans(args, &files, vehicle.as_ref(), clock)?;
    let anonymous = match &vehicle {
        Some(vehicle) if args.anonymise => Some(Anonymous::of(&log, vehicle)?),
        _ => None,
    };
    let mut said = what_is_done(args, &files, &spans)?;
    let trimmed = write(args, &files, &spans, vehicle.as_ref(), anonymous.as_ref(), &said)?;
    said.extend(anonymous.iter().flat_map(|anonymous| anonymous.left.clone()));
    tell(args, (&trimmed, clock), &spans, &said)?;
    Ok(if trimmed.losses > 0 { failure::DATA_LOST } else { failure::OK })
}

/// Whether the options need a vehicle file.
fn needs_vehicle(args: &Trim) -> bool {
    args.chainage.is_some() || args.drop_echoes || args.anonymise
}

/// The vehicle given or attached to the log; `None` if the options need no vehicle.
fn vehicle(
    args: &Trim,
    given: Given,
    files: &[PathBuf],
    info: &LogInfo,
) -> Result<Option<VehicleConfig>, Failure> {
    if !needs_vehicle(args) {
        return Ok(None);
    }
    let losses = Player::open(files)?.losses();
    let (_, vehicle) = given.or_attached(info, &losses, files::first_named(&args.logs))?;
    Ok(Some(vehicle))
}

/// Spans of log time to keep; empty if all is kept.
fn spans(
    args: &Trim,
    files: &[PathBuf],
    vehicle: Option<&VehicleConfig>,
    clock: DiveClock,
) -> Result<Vec<(MonoNs, MonoNs)>, Failure> {
    if let (Some([from_m, to_m]), Some(vehicle)) = (args.chainage, vehicle) {
        let spans = when_within(files, vehicle, from_m, to_m)?;
        if spans.is_empty() {
            return Err(Failure::Usage(format!(
                "trim: the vehicle was never between {from_m} and {to_m} m in {}",
                files::first_named(&args.logs).display()
            )));
        }
        return Ok(spans);
    }
    if args.from.is_none() && args.to.is_none() {
        return Ok(Vec::new());
    }
    // Messages from before the first sensor packet have dive time zero, too.
    let from = args.from.filter(|from| from.0 > 0).map_or(MonoNs(0), |from| clock.timestamp(from));
    let to = args.to.map_or(MonoNs(u64::MAX), |to| clock.timestamp(to));
    if from >= to {
        return Err(Failure::Usage("trim: --from must be before --to".to_owned()));
    }
    Ok(vec![(from, to)])
}

/// Spans of log time in which the vehicle was within a range of chainage, m. They are found by a replay.
fn when_within(
    files: &[PathBuf],
    vehicle: &VehicleConfig,
    from_m: f64,
    to_m: f64,
) -> Result<Vec<(MonoNs, MonoNs)>, Failure> {
    let dive = Assembly::of(vehicle, "").kept(true).assemble()?;
    let mut player = Player::open(files)?;
    player.connect(dive.armed.sources());
    let mut spans: Vec<(MonoNs, MonoNs)> = Vec::new();
    let pace = Pace { tick: TICK, speed: None };
    dive.run(&mut player, pace, &mut Watch::quiet(), &mut |dive| {
        let now = dive.now();
        let Ok(fix) = dive.fix(now) else { return };
        if !(from_m..=to_m).contains(&fix.pose.position.x()) {
            return;
        }
        let begun = MonoNs(now.0.saturating_sub(TICK.0.cast_unsigned()));
        match spans.last_mut() {
            Some((_, to)) if begun.since(*to) <= BRIDGED => *to = now,
            _ => spans.push((begun, now)),
        }
    })?;
    Ok(spans)
}

/// Text about the changes to the log.
fn what_is_done(args: &Trim, files: &[PathBuf], spans: &[(MonoNs, MonoNs)]) -> Result<Vec<String>, Failure> {
    let mut said = Vec::new();
    if args.anonymise {
        said.push("anonymised".to_owned());
    } else {
        let names: Vec<String> = files.iter().map(|file| file.display().to_string()).collect();
        said.push(format!("of {} (sha256 {})", names.join(", "), files_digest(files)?));
    }
    if let Some([from_m, to_m]) = args.chainage {
        said.push(format!("cut to chainage {from_m} to {to_m} m: {} time spans", spans.len()));
    } else if !spans.is_empty() {
        said.push("cut in time".to_owned());
    }
    if !spans.is_empty() {
        said.push("without live results".to_owned());
    }
    if args.drop_echoes {
        said.push("without echo data".to_owned());
    }
    Ok(said)
}

/// Writes the trimmed log atomically.
fn write(
    args: &Trim,
    files: &[PathBuf],
    spans: &[(MonoNs, MonoNs)],
    vehicle: Option<&VehicleConfig>,
    anonymous: Option<&Anonymous>,
    said: &[String],
) -> Result<Trimmed, Failure> {
    let failed = |source| Failure::Write { path: args.output.clone(), source };
    let sources = DiveLog::open(files)?.header().sources.clone();
    let device = |source: u16| {
        let id = &sources.get(usize::from(source))?.id;
        let configs = vehicle?.sensor_configs.iter().zip(&vehicle?.sensors);
        configs.into_iter().find(|(config, _)| config.id == *id).map(|(_, device)| device)
    };
    let wanted = [(args.drop_echoes, OptionalPayload::Echoes), (args.anonymise, OptionalPayload::Identity)];
    let mut between = Vec::new();
    let mut change = |source: u16, bytes: &[u8], shorter: &mut Vec<u8>| {
        if args.anonymise && sources.get(usize::from(source)).is_some_and(|source| source.id == CONSOLE_ID) {
            *shorter = Command::parse(bytes)
                .map_or(Vec::new(), |command| command.anonymous().to_json().into_bytes());
            return true;
        }
        let Some(device) = device(source) else { return false };
        let mut changed = false;
        for (_, what) in wanted.iter().filter(|(wanted, _)| *wanted) {
            let packet = if changed { between.as_slice() } else { bytes };
            if device.without(*what, packet, shorter) {
                changed = true;
                between.clone_from(shorter);
            }
        }
        shorter.clone_from(&between);
        changed
    };
    let header = |_: &LogInfo, header: LogHeader| match anonymous {
        Some(anonymous) => anonymous.header(header),
        None => header,
    };
    let mut work = Work {
        spans: spans.to_vec(),
        words: said.join("; "),
        header: &header,
        change: &mut change,
        voices: !args.anonymise,
        // Alerts and notes contain names of people, so an anonymised log leaves out the topic of alerts and notes.
        results: &|topic| !args.anonymise || !topic.ends_with("/alerts"),
    };
    let mut file = AtomicFile::create(&args.output).map_err(failed)?;
    let mut writer = Writing::new(&mut file, files::bytes(files));
    let trimmed = rewrite(&mut || DiveLog::open(files), &mut writer, &mut work, &result_channels())
        .map_err(Failure::writing(&args.output))?;
    drop(writer);
    if trimmed.bytes_before == 0 && !spans.is_empty() {
        return Err(nothing_kept(args, files)?);
    }
    file.flush().and_then(|()| file.complete()).map_err(failed)?;
    Ok(trimmed)
}

/// Error if no message of a sensor is within the requested times or chainages.
fn nothing_kept(args: &Trim, files: &[PathBuf]) -> Result<Failure, Failure> {
    let last = DiveLog::open(files)?.times().map_or(MonoNs(0), |times| times.1);
    let option = |name: &str, at: Option<DurNs>| at.map(|at| format!("{name} {} s", at.as_secs_f64()));
    let asked = [option("--from", args.from), option("--to", args.to)];
    let chainage = args.chainage.map(|[from_m, to_m]| format!("--chainage {from_m}..{to_m}"));
    let asked: Vec<String> = asked.into_iter().flatten().chain(chainage).collect();
    Ok(Failure::Usage(format!(
        "trim: no sensor's message of {} is within {}; the dive lasts from 0 s to {}",
        files::first_named(&args.logs).display(),
        asked.join(" "),
        seconds(last, clock_of(files)?)
    )))
}

/// Shows the parts that were trimmed, with dive times.
fn tell(
    args: &Trim,
    (trimmed, clock): (&Trimmed, DiveClock),
    spans: &[(MonoNs, MonoNs)],
    said: &[String],
) -> Result<(), Failure> {
    let Trimmed { messages, cut, results, changed, emptied, bytes_before, bytes_after, losses, span } =
        *trimmed;
    if args.json {
        let spans: Vec<_> =
            spans.iter().map(|(from, to)| json!({"from_ns": from.0, "to_ns": to.0})).collect();
        let report = json!({
            "log": args.output.display().to_string(), "messages": messages, "cut": cut, "results_left_out": results,
            "changed": changed, "emptied": emptied, "sensor_bytes_before": bytes_before, "sensor_bytes": bytes_after,
            "losses": losses, "spans": spans, "done": said,
        });
        return deliver(&report.to_string());
    }
    for words in said {
        say(&format!("done     {words}"));
    }
    if changed > 0 {
        say(&format!(
            "changed  {changed} sensor messages, {emptied} of them now empty; from {bytes_before} to {bytes_after} bytes"
        ));
    }
    if losses > 0 {
        say(&format!("lost     {losses} losses of the source log are stated in the new one"));
    }
    let span = span
        .map(|(from, to)| format!(", {} to {}", seconds(from, clock), seconds(to, clock)))
        .unwrap_or_default();
    let results = if results > 0 { format!(" and {results} of results") } else { String::new() };
    say(&format!("kept     {messages} messages{span}; left out {cut}{results}"));
    say(&format!("log      {}", args.output.display()));
    Ok(())
}
