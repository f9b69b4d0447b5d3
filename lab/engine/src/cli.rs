//! The command line.

use std::io::{IsTerminal as _, Write as _};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use clap::Parser;
use headrace_campaign::cache::Cache;
use headrace_campaign::campaign::{Campaign, Finished};
use headrace_campaign::maker::{Made, Maker};
use headrace_campaign::place::Place;
use headrace_campaign::questions::{QUESTIONS, Question};
use headrace_campaign::{Error, output, picture};
use headrace_tables::{Parameters, program_version};

#[cfg(feature = "cluster")]
mod cluster;

/// Options that need no folder.
#[cfg(feature = "cluster")]
const NO_FOLDER: [&str; 3] = ["questions", "schedule", "executor"];
#[cfg(not(feature = "cluster"))]
const NO_FOLDER: [&str; 1] = ["questions"];
/// Exit code: success on all the data.
const OK: u8 = 0;
/// Exit code: a query can't be answered.
const FAILED: u8 = 1;
/// Exit code: a file or an argument is invalid.
const USAGE: u8 = 2;
/// Exit code: finished, but some logs couldn't be replayed, or lost data.
const DATA_LOST: u8 = 3;

/// Query the dives of a folder or bucket in SQL. Each dive is replayed once, and its tables are cached.
#[derive(Debug, Parser)]
#[command(name = "headrace-campaign", version = program_version(), after_help = "\
Tables: dives, sections, holes, flags, runs, sources, alerts; the same tables of another version as before_dives, ...; and the \
table function replay(log, parameters [, table]). docs/reference/dive-tables.csv has their columns.

Examples:
  headrace campaign dives/ --question worst --picture worst.svg
  headrace campaign dives/ --sql \"SELECT verdict, sum(end_m - chainage_m) FROM sections GROUP BY verdict\"
  headrace campaign s3://bucket/dives --target 0.3 --out dives.parquet --sql \"SELECT * FROM dives\"
  headrace batch dives/ --shard 3/20 --out results/

Exit code: 0 success, 1 a query can't be answered, 2 invalid file or argument, 3 finished, but some logs couldn't be replayed or have lost data.")]
pub(crate) struct Arguments {
    /// Folder of logs, searched with its folders, or s3://BUCKET/PREFIX.
    #[arg(value_name = "FOLDER", required_unless_present_any = NO_FOLDER)]
    folder: Option<String>,
    /// SQL query.
    #[arg(long, conflicts_with = "question")]
    sql: Option<String>,
    /// Predefined question, by name; --questions lists them.
    #[arg(long, value_name = "NAME")]
    question: Option<String>,
    /// List the predefined questions.
    #[arg(long)]
    questions: bool,
    /// Output file of the answer: .csv, .json (lines) or .parquet. With --shard, output folder of the tables.
    #[arg(short, long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// SVG chart of the answer.
    #[arg(long, value_name = "FILE.svg")]
    picture: Option<PathBuf>,
    /// Target T, metres, overriding the vehicle files'.
    #[arg(long, value_name = "METRES")]
    target: Option<f64>,
    /// Section length, metres, overriding the vehicle files'.
    #[arg(long, value_name = "METRES")]
    section: Option<f64>,
    /// Speed of sound in the water, m/s, overriding the vehicle files'.
    #[arg(long, value_name = "M/S")]
    sound_speed: Option<f64>,
    /// Vehicle file, overriding those attached to the logs.
    #[arg(long, value_name = "FILE")]
    vehicle: Option<PathBuf>,
    /// Use the smoothed trajectories.
    #[arg(long)]
    smooth: bool,
    /// Number of simultaneous replays; by default one per core.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
    /// Cache folder for tables; by default ~/.cache/headrace.
    #[arg(long, value_name = "DIR")]
    cache: Option<PathBuf>,
    /// Program version to compare with, for before_dives and similar tables; by default the one with most dives in the cache.
    #[arg(long, value_name = "VERSION")]
    before: Option<String>,
    /// Replay only every N-th dive, beginning with number I, and write the tables to the folder --out.
    #[arg(long, value_name = "I/N", value_parser = shard, requires = "out", conflicts_with_all = ["sql", "question", "picture", "cache"])]
    shard: Option<(usize, usize)>,
    #[cfg(feature = "cluster")]
    #[command(flatten)]
    cluster: cluster::Arguments,
    /// Set for `headrace batch`, which acts as --shard 1/1 unless a shard is given.
    #[arg(long, hide = true, requires = "out")]
    batch: bool,
}

/// Number and count of a shard.
fn shard(text: &str) -> Result<(usize, usize), String> {
    let both = text.split_once('/').and_then(|(i, n)| Some((i.parse().ok()?, n.parse().ok()?)));
    both.filter(|(i, n)| (1..=*n).contains(i))
        .ok_or_else(|| "expected I/N, I from 1 to N, like 3/20".to_owned())
}

/// Exit code of an error.
pub(crate) fn exit_code(error: &Error) -> u8 {
    match error {
        Error::Place { .. } | Error::NoLogs(_) | Error::About { .. } | Error::Usage(_) | Error::Tables(_) => {
            USAGE
        }
        _ => FAILED,
    }
}

/// Runs the command; returns the exit code.
pub(crate) fn run(arguments: &Arguments) -> Result<u8, Error> {
    if arguments.questions {
        for question in QUESTIONS {
            say(&format!("{:10} {}", question.name, question.about()))?;
        }
        return Ok(OK);
    }
    let cores = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
    let threads = arguments.threads.map_or(cores, usize::from);
    let mut runtime = tokio::runtime::Builder::new_multi_thread();
    runtime.worker_threads(threads).enable_all();
    // The stack is large, because the scheduler traverses plans recursively.
    #[cfg(feature = "cluster")]
    let runtime = runtime.thread_stack_size(32 << 20);
    let runtime = runtime.build();
    let runtime = runtime.map_err(|error| Error::Usage(format!("starting {threads} threads: {error}")))?;
    runtime.block_on(work(arguments, threads))
}

async fn work(arguments: &Arguments, threads: usize) -> Result<u8, Error> {
    let maker = Arc::new(Maker::new(Cache::open(&cache_folder(arguments)?)?, threads));
    #[cfg(feature = "cluster")]
    if arguments.cluster.serve(&maker, threads).await? {
        return Ok(OK);
    }
    if let Some(out) = arguments.out.as_deref().filter(|_| !is_batch(arguments)) {
        output::check(out)?;
    }
    let sql = match (&arguments.sql, &arguments.question) {
        (Some(sql), _) => Some(sql.clone()),
        (None, Some(name)) => Some(found(name)?.sql.to_owned()),
        (None, None) => None,
    };
    let place = Place::open(arguments.folder.as_deref().unwrap_or_default())?;
    let mut campaign = Campaign::open(place, parameters(arguments)?, maker, threads).await?;
    #[cfg(feature = "cluster")]
    if let Some(session) = arguments.cluster.session(&campaign)? {
        campaign.send_to(session)?;
    }
    if is_batch(arguments) {
        let (number, of) = arguments.shard.unwrap_or((1, 1));
        campaign.keep_shard(number, of);
    }
    here(&campaign, arguments, sql.as_deref()).await
}

/// Replays the dives and answers the query from this machine.
async fn here(campaign: &Campaign, arguments: &Arguments, sql: Option<&str>) -> Result<u8, Error> {
    let finished = make(campaign).await?;
    if let Some(sql) = sql {
        let session = campaign.session(&finished, arguments.before.as_deref())?;
        answer(&session, sql, arguments).await?;
    }
    summary(campaign, &finished, arguments);
    Ok(code(&finished))
}

/// Answers SQL in a session.
async fn answer(
    session: &datafusion::prelude::SessionContext,
    sql: &str,
    arguments: &Arguments,
) -> Result<(), Error> {
    let frame = session.sql(sql).await?;
    let schema = Arc::new(frame.schema().as_arrow().clone());
    let batches = frame.collect().await?;
    // The batches' own schema is preferred, because it has string views and states which columns may be null.
    let schema = batches.first().map_or(schema, datafusion::arrow::array::RecordBatch::schema);
    if let Some(path) = &arguments.picture {
        let svg = picture::draw(sql, &schema, &batches)?;
        std::fs::write(path, svg).map_err(|source| Error::File {
            doing: "writing",
            path: path.clone(),
            source,
        })?;
    }
    match &arguments.out {
        Some(path) => output::write(path, &schema, &batches),
        None => say(&output::pretty(&batches)?),
    }
}

async fn make(campaign: &Campaign) -> Result<Finished, Error> {
    let (all, mut done) = (campaign.dives.len(), 0);
    let shows = std::io::stderr().is_terminal();
    let finished = campaign
        .make(&mut |dive, made| {
            done += 1;
            if shows {
                eprint!("\r{done} of {all} dives\x1b[K");
            }
            if let Made::Unread(tables) = made {
                let error = tables.dives.column_by_name("error").cloned();
                let error = error.and_then(|of| output::only_text(&of)).unwrap_or_default();
                eprintln!("{}headrace-campaign: {}: {error}", if shows { "\r" } else { "" }, dive.log);
            }
        })
        .await;
    if shows {
        eprint!("\r\x1b[K");
    }
    finished
}

fn summary(campaign: &Campaign, finished: &Finished, arguments: &Arguments) {
    for (copy, of) in &finished.copies {
        eprintln!("headrace-campaign: {copy} is a copy of {of}; both count as one dive");
    }
    if !is_batch(arguments) {
        for log in &finished.unknown {
            eprintln!("headrace-campaign: dives.csv names {log}, which doesn't exist");
        }
    }
    let counts = campaign.maker.counts();
    let (unread, lost) = finished.failures();
    eprintln!(
        "{} dives: {} replayed, {} from the cache{}; {unread} unreadable, {lost} with lost data",
        finished.dives.len(),
        counts.replayed(),
        counts.cached(),
        if counts.broken() > 0 { format!(", {} damaged there", counts.broken()) } else { String::new() }
    );
}

fn code(finished: &Finished) -> u8 {
    if finished.failures() == (0, 0) { OK } else { DATA_LOST }
}

fn is_batch(arguments: &Arguments) -> bool {
    arguments.batch || arguments.shard.is_some()
}

fn found(name: &str) -> Result<Question, Error> {
    let names = QUESTIONS.map(|question| question.name).join(", ");
    Question::find(name).ok_or_else(|| Error::Usage(format!("--question {name}: expected one of {names}")))
}

fn parameters(arguments: &Arguments) -> Result<Parameters, Error> {
    let mut parameters = Parameters {
        target_m: arguments.target,
        section_m: arguments.section,
        sound_speed_mps: arguments.sound_speed,
        smooth: arguments.smooth,
        ..Parameters::default()
    };
    if let Some(path) = &arguments.vehicle {
        parameters.read_vehicle(path)?;
    }
    Ok(parameters)
}

fn cache_folder(arguments: &Arguments) -> Result<PathBuf, Error> {
    if let Some(out) = arguments.out.as_deref().filter(|_| is_batch(arguments)) {
        return Ok(out.to_owned());
    }
    if let Some(cache) = &arguments.cache {
        return Ok(cache.clone());
    }
    let below =
        |variable: &str, name: &str| std::env::var_os(variable).map(|base| Path::new(&base).join(name));
    below("XDG_CACHE_HOME", "headrace")
        .or_else(|| below("HOME", ".cache/headrace"))
        .ok_or_else(|| Error::Usage("no cache folder for tables; give one with --cache".to_owned()))
}

fn say(text: &str) -> Result<(), Error> {
    writeln!(std::io::stdout(), "{text}").map_err(|source| Error::File {
        doing: "writing",
        path: "stdout".into(),
        source,
    })
}
