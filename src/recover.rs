//! `headrace recover`: writes the readable part of a damaged log as a valid log.

use std::io::Write as _;
use std::path::{Path, PathBuf};

use headrace_geometry::time::DiveClock;
use headrace_replay::atomic_file::AtomicFile;
use headrace_replay::clocks::clock_of;
use headrace_replay::log::{DiveLog, Recovered, files_digest, files_of, recover as rewrite};
use headrace_replay::record::result_channels;
use serde_json::json;

use crate::cli::Recover;
use crate::failure::{self, Failure};
use crate::files;
use crate::output::{deliver, say};
use crate::outputs::{Claims, Kind};
use crate::progress::Writing;

/// Runs `headrace recover`.
pub(crate) fn recover(args: &Recover) -> Result<u8, Failure> {
    // The log is opened first, so that an error of reading it comes before the output is created.
    let files = files_of(&args.logs)?;
    DiveLog::open(&files)?;
    Claims::reading(files.clone(), &args.overwrite).claim("-o", &args.output, Kind::Recovered)?;
    let recovered = write(&files, &args.output)?;
    tell(args, &recovered, clock_of(&files)?)?;
    Ok(if recovered.losses.is_empty() { failure::OK } else { failure::DATA_LOST })
}

/// Writes the recovered log atomically.
fn write(files: &[PathBuf], output: &Path) -> Result<Recovered, Failure> {
    let failed = |source| Failure::Write { path: output.to_owned(), source };
    let names: Vec<String> = files.iter().map(|file| file.display().to_string()).collect();
    let from = format!("{} (sha256 {})", names.join(", "), files_digest(files)?);
    let mut file = AtomicFile::create(output).map_err(failed)?;
    let mut writer = Writing::new(&mut file, files::bytes(files));
    let recovered = rewrite(&mut || DiveLog::open(files), &mut writer, &result_channels(), &from)
        .map_err(Failure::writing(output))?;
    drop(writer);
    file.flush().and_then(|()| file.complete()).map_err(failed)?;
    Ok(recovered)
}

fn tell(args: &Recover, recovered: &Recovered, clock: DiveClock) -> Result<(), Failure> {
    let seconds = recovered.span.map(|(from, to)| [clock.seconds(from), clock.seconds(to)]);
    if args.json {
        let losses = recovered.losses.iter().map(|loss| {
            json!({
                "what": loss.in_dive_time(clock).to_string(), "from_ns": loss.from.map(|at| at.0), "to_ns": loss.to.map(|at| at.0),
                "offset": loss.offset, "bytes": loss.bytes,
            })
        });
        let report = json!({
            "log": args.output.display().to_string(), "messages": recovered.messages,
            "from_s": seconds.map(|span| span[0]), "to_s": seconds.map(|span| span[1]),
            "losses": losses.collect::<Vec<_>>(),
        });
        return deliver(&report.to_string());
    }
    for loss in &recovered.losses {
        say(&format!("lost     {}", loss.in_dive_time(clock)));
    }
    let span = seconds.map(|[from, to]| format!(", {:.3} s", to - from)).unwrap_or_default();
    let nothing = if recovered.losses.is_empty() { "; nothing is missing" } else { "" };
    say(&format!("kept     {} messages{span}{nothing}", recovered.messages));
    say(&format!("log      {}", args.output.display()));
    Ok(())
}
