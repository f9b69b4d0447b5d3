//! `headrace deliver`: the report of a recorded dive for the owner of the plant, as HTML, PDF and JSON, and files for
//! other programs.

use std::path::{Path, PathBuf};
use std::{fs, io};

use headrace_config::Document;
use headrace_deliver::collect::{self, Collector};
use headrace_deliver::document::{html, pdf};
use headrace_deliver::files::data::FileInfo;
use headrace_deliver::report::{About, Delivery, Wall};
use headrace_replay::drive::Pace;
use headrace_replay::log::files_of;
use headrace_replay::player::Player;

use crate::cli::Deliver;
use crate::dive::Assembly;
use crate::failure::Failure;
use crate::files;
use crate::output::say;
use crate::outputs::{self, Claims, Kind};
use crate::page;
use crate::report_output::{exit_code, note_losses, state_utc};
use crate::vehicle_file::Given;
use crate::watch::Watch;

/// Files of the report.
const FILES: [&str; 3] = ["report.html", "report.pdf", "report.json"];
/// Folder for the files while they are written, in the folder of the delivery. They are moved when all are complete.
const UNFINISHED: &str = ".unfinished";

/// Runs `headrace deliver`.
pub(crate) fn deliver(args: &Deliver) -> Result<u8, Failure> {
    let files = files_of(&args.logs)?;
    let given = Given::read(args.vehicle.as_deref())?;
    let about = about(args)?;
    // The log comes before the folder, so that a log that can't be read leaves no empty folder behind.
    let player = Player::open(&files)?;
    claim(args, files.iter().chain(&given.files).chain(&args.about).cloned())?;
    let unfinished = args.output.join(UNFINISHED);
    remove(&unfinished)?;
    outputs::folder(&unfinished)?;
    let delivered = deliver_to(&unfinished, args, player, given, &about);
    remove(&unfinished)?;
    delivered
}

/// Writes the files to a folder and moves them from there when all are complete.
fn deliver_to(
    unfinished: &Path,
    args: &Deliver,
    mut player: Player,
    given: Given,
    about: &About,
) -> Result<u8, Failure> {
    let log = files::first_named(&args.logs);
    let (text, vehicle) = given.or_attached(player.info(), &player.losses(), log)?;
    let utc_of_zero_s = page::utc_of_zero_s(&player.info().metadata);
    let dive = Assembly::of(&vehicle, &text).kept(true).assemble()?;
    player.connect(dive.armed.sources());
    let mut wall = Wall::new(&dive.armed);
    let program = concat!("headrace ", env!("CARGO_PKG_VERSION")).to_owned();
    // Date and identity are set after the replay, from which they follow.
    let info = FileInfo { title: about.title(), program, date: None, id: [0; 16] };
    let mut collector = Collector::new(unfinished, &info)?;
    let feed = (&mut player as _, Pace::default());
    let threads = args.threads.of_replay();
    let mut report = dive.run_on(threads, feed, &mut Watch::quiet(), &mut |dive| {
        wall.take(dive);
        collector.take(dive);
    })?;
    collector.finish(unfinished)?;
    note_losses(&mut report, log, &player);
    state_utc(&mut report, utc_of_zero_s);
    let delivery =
        Delivery { about, report: &report, wall: &wall, every_m: args.every, vehicle: &vehicle.name };
    let unknown = write_report(unfinished, &delivery)?;
    collect::write_files(unfinished, &info, &delivery)?;
    publish(unfinished, &args.output)?;
    let [html, pdf, json] = FILES.map(|name| args.output.join(name).display().to_string());
    say(&format!("report {html}, {pdf} and {json}"));
    if !unknown.is_empty() {
        say(&format!(
            "the PDF shows question marks for {unknown}, which its font lacks; print the HTML instead"
        ));
    }
    for loss in report.log.iter().flat_map(|log| &log.losses) {
        say(&format!("LOST: {loss}"));
    }
    Ok(exit_code(&report))
}

/// Writes the report in its three forms. Returns the letters that the PDF can't show.
fn write_report(folder: &Path, delivery: &Delivery<'_>) -> Result<String, Failure> {
    // Rounded up, so that the stated distance is allowed.
    let least_m = (delivery.least_every_m() * 1000.0).ceil() / 1000.0;
    if let Some(every_m) = delivery.every_m.filter(|every_m| *every_m < least_m) {
        return Err(Failure::Usage(format!(
            "--every {every_m}: the dive would have over 2000 cross-sections; allowed is {least_m:.3} m or more"
        )));
    }
    let document = delivery.document();
    let [html_file, pdf_file, json_file] = FILES.map(|name| folder.join(name));
    files::write(&html_file, html(&document).as_bytes())?;
    let pdf = pdf(&document);
    files::write(&pdf_file, &pdf.bytes)?;
    files::write_json(&json_file, delivery.report)?;
    Ok(pdf.unknown.iter().collect())
}

/// Creates the folder, and claims its files.
fn claim(args: &Deliver, inputs: impl IntoIterator<Item = PathBuf>) -> Result<(), Failure> {
    let folder = &args.output;
    let is_foreign =
        |entry: io::Result<fs::DirEntry>| entry.is_ok_and(|entry| entry.file_name() != UNFINISHED);
    let is_empty = || folder.read_dir().is_ok_and(|mut entries| !entries.any(is_foreign));
    if folder.exists() && !args.overwrite.force && !is_empty() {
        return Err(Failure::Usage(format!(
            "writing {}: it isn't an empty folder; give another name, or overwrite its files with --force",
            folder.display()
        )));
    }
    outputs::folder(folder)?;
    let mut claims = Claims::reading(inputs, &args.overwrite);
    for file in names().map(|name| folder.join(name)) {
        claims.claim("-o", &file, Kind::Delivered)?;
    }
    Ok(())
}

/// Names of all files of a delivery.
fn names() -> impl Iterator<Item = &'static str> {
    FILES.into_iter().chain(collect::FILES)
}

/// Removes the folder of a delivery that was not completed, if there is one.
fn remove(unfinished: &Path) -> Result<(), Failure> {
    match fs::remove_dir_all(unfinished) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => {
            Err(Failure::Write { path: unfinished.to_owned(), source: error })
        }
        _ => Ok(()),
    }
}

/// Moves the complete files to the folder of the delivery. Files of an earlier delivery that this one doesn't have are
/// removed.
fn publish(unfinished: &Path, folder: &Path) -> Result<(), Failure> {
    for name in names() {
        let (from, to) = (unfinished.join(name), folder.join(name));
        let done = if from.exists() { fs::rename(&from, &to) } else { fs::remove_file(&to) };
        match done {
            Err(error) if error.kind() != io::ErrorKind::NotFound => {
                return Err(Failure::Write { path: to, source: error });
            }
            _ => {}
        }
    }
    Ok(())
}

/// Facts for the report's cover. Options take precedence over the file.
fn about(args: &Deliver) -> Result<About, Failure> {
    let file = args.about.as_deref().map(read_about).transpose()?.unwrap_or_default();
    let crew = (!args.crew.is_empty()).then(|| args.crew.join(", "));
    Ok(About {
        plant: args.plant.clone().or(file.plant),
        tunnel: args.tunnel.clone().or(file.tunnel),
        client: args.client.clone().or(file.client),
        date: args.date.clone().or(file.date),
        crew: crew.or(file.crew),
    })
}

fn read_about(path: &Path) -> Result<About, Failure> {
    let (name, text) = (path.display().to_string(), files::read(path)?);
    let about = Document::new(&name, &text).read(|root| {
        Ok(About {
            plant: root.text("plant")?,
            tunnel: root.text("tunnel")?,
            client: root.text("client")?,
            date: root.text("date")?,
            crew: root.texts("crew")?.map(|names| names.join(", ")),
        })
    });
    Ok(about?)
}
