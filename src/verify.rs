//! `headrace verify`: compares a replay with the results published live.

use std::path::PathBuf;

use headrace_geometry::time::DurNs;
use headrace_monitor::SourceInfo;
use headrace_monitor::result_stream::WordKind;
use headrace_replay::drive::Pace;
use headrace_replay::log::{TRIMMED, files_of};
use headrace_replay::player::Player;
use headrace_replay::verify::{Difference, Verified, Verifier, What};
use serde_json::{Value, json};

use crate::cli::Verify;
use crate::dive::{Assembly, Dive};
use crate::failure::{self, Failure};
use crate::files;
use crate::output::{deliver, say};
use crate::vehicle_file::Given;
use crate::watch::Watch;

/// Runs `headrace verify`.
pub(crate) fn verify(args: &Verify) -> Result<u8, Failure> {
    let files = files_of(&args.logs)?;
    let given = Given::read(args.vehicle.as_deref())?;
    let mut player = Player::open(&files)?;
    let (_, vehicle) = given.or_attached(player.info(), &player.losses(), files::first_named(&args.logs))?;
    let trimmed = player.info().metadata.get(TRIMMED).cloned();
    let dive = Assembly::of(&vehicle, "").kept(true).assemble()?;
    let sources: Vec<SourceInfo> = dive.armed.sources().to_vec();
    player.connect(&sources);
    let verified = compared(args, &files, &mut player, dive)?;
    tell(args, &verified, (&player.losses(), trimmed.as_deref()), &sources)
}

/// Replays a log, and compares the results.
fn compared(args: &Verify, files: &[PathBuf], player: &mut Player, dive: Dive) -> Result<Verified, Failure> {
    let tick = DurNs::from_millis(i64::from(args.tick_ms));
    let mut verifier = Verifier::open(files)?;
    let mut failed = None;
    dive.run_on(
        args.threads.of_replay(),
        (player, Pace { tick, speed: None }),
        &mut Watch::quiet(),
        &mut |dive| {
            if failed.is_none() {
                failed = verifier.after_tick(dive).err();
            }
        },
    )?;
    if let Some(error) = failed {
        return Err(error.into());
    }
    Ok(verifier.finish()?)
}

fn tell(
    args: &Verify,
    verified: &Verified,
    (losses, trimmed): (&[String], Option<&str>),
    sources: &[SourceInfo],
) -> Result<u8, Failure> {
    let code = if !verified.differences.is_empty() {
        failure::DIVERGED
    } else if !verified.has_results {
        failure::FAILED
    } else if !losses.is_empty() {
        failure::DATA_LOST
    } else {
        failure::OK
    };
    if args.json {
        let differences: Vec<Value> =
            verified.differences.iter().map(|difference| as_json(difference, sources)).collect();
        let answer = json!({
            "same_records": verified.same, "unrecorded_records": verified.unrecorded, "differences": differences,
            "losses": losses,
        });
        deliver(&answer.to_string())?;
        return Ok(code);
    }
    for loss in losses {
        say(&format!("lost     {loss}"));
    }
    if !verified.has_results {
        say(match trimmed {
            Some(_) => {
                "nothing to compare: this log is an extract without live results; verify the original log"
            }
            None => "nothing to compare: this log has no live results; headrace run and demo record them",
        });
        return Ok(code);
    }
    for difference in &verified.differences {
        say(&text(difference, sources));
    }
    let unrecorded = match verified.unrecorded {
        0 => String::new(),
        count => format!("; {count} live results are missing in the log"),
    };
    let verdict = if verified.differences.is_empty() {
        "the replay equals the dive"
    } else {
        "the replay differs from the dive"
    };
    say(&format!("{verdict}: {} results are identical bit for bit{unrecorded}", verified.same));
    Ok(code)
}

fn text(difference: &Difference, sources: &[SourceInfo]) -> String {
    let Difference { tick, stream, record, what } = difference;
    let place = format!("{stream}: first difference at tick {tick}, result {record}");
    match what {
        What::Field { kind, source, field, word, live, replayed } => {
            let of = source.map(|source| format!(" of {}", name(source, sources))).unwrap_or_default();
            let (kind, live, replayed) = (kind.as_str(), value(*word, *live), value(*word, *replayed));
            format!("{place}: {kind}{of}: {field} live {live}, replayed {replayed}")
        }
        What::Kind { live, replayed } => {
            format!(
                "{place}: the results differ in kind or number of fields: live {live:?}, replayed {replayed:?}"
            )
        }
        What::Missing => format!("{place}: missing in the replay"),
        What::Added => format!("{place}: only in the replay"),
    }
}

/// A result's value as text. The text of a float also has the float's bits.
fn value(word: WordKind, bits: u64) -> String {
    match word {
        WordKind::Integer => format!("{bits}"),
        WordKind::Number => format!("{:?} ({bits:#018x})", f64::from_bits(bits)),
    }
}

fn name(source: u64, sources: &[SourceInfo]) -> String {
    let of = usize::try_from(source).ok().and_then(|source| sources.get(source));
    of.map_or_else(|| source.to_string(), |source| source.id.clone())
}

fn as_json(difference: &Difference, sources: &[SourceInfo]) -> Value {
    let Difference { tick, stream, record, what } = difference;
    let mut answer =
        json!({"tick": tick, "stream": stream, "record": record, "what": text(difference, sources)});
    if let (What::Field { source, field, live, replayed, .. }, Some(answer)) = (what, answer.as_object_mut())
    {
        answer.insert("source".to_owned(), json!(source.map(|source| name(source, sources))));
        answer.insert("field".to_owned(), json!(field));
        answer.insert("live_bits".to_owned(), json!(format!("{live:016x}")));
        answer.insert("replayed_bits".to_owned(), json!(format!("{replayed:016x}")));
    }
    answer
}
