//! The paper on the terminal: its tables computed anew, its experiments run anew.

mod experiments;
mod pictures;
mod tables;

use headrace_experiments::{Dives, run};
use headrace_sampling::paper;

use crate::cli::Paper;
use crate::devices::KINDS;
use crate::failure::{self, Failure};
use crate::files;
use crate::output::{deliver, put, say};
use crate::progress::Progress;

/// Shows the paper's tables, or runs its experiments, ours beside theirs.
pub(crate) fn paper(args: &Paper) -> Result<u8, Failure> {
    if args.experiments {
        return experiments(args);
    }
    if !args.tables {
        let what = "paper: --tables shows its Tables 1 to 5 computed anew, --experiments runs its §8 and §9";
        return Err(Failure::Usage(what.to_owned()));
    }
    let tables = paper::tables().map_err(|error| Failure::Read {
        path: "the built-in tables of the paper".into(),
        source: std::io::Error::other(error),
    })?;
    if args.json {
        deliver(&serde_json::to_string_pretty(&tables)?)?;
    } else {
        put(&tables::words(&tables));
    }
    Ok(failure::OK)
}

fn experiments(args: &Paper) -> Result<u8, Failure> {
    let dives = Dives { kinds: &KINDS, load: &files::built_in_vehicle };
    let progress = std::cell::RefCell::new(Progress::start());
    let report = run(&dives, &|what| progress.borrow_mut().step(what))?;
    drop(progress);
    if args.json {
        deliver(&serde_json::to_string_pretty(&report)?)?;
    } else {
        put(&experiments::words(&report));
    }
    if let Some(folder) = &args.svg {
        std::fs::create_dir_all(folder).map_err(|source| Failure::Write { path: folder.clone(), source })?;
        for (name, svg) in pictures::all(&dives)? {
            files::write(&folder.join(name), svg.as_bytes())?;
        }
        if !args.json {
            say(&format!("\npictures in {}", folder.display()));
        }
    }
    Ok(failure::OK)
}
