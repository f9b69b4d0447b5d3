//! `headrace deliver`: the report of a recorded dive for the owner of the plant, as HTML, PDF and JSON, and files for
//! other programs.

use std::path::{Path, PathBuf};

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

/// Files of a delivery.
const FILES: [&str; 3] = ["report.html", "report.pdf", "report.json"];

/// Runs `headrace deliver`.
pub(crate) fn deliver(args: &Deliver) -> Result<u8, Failure> {
    let (files, log) = (files_of(&args.logs)?, files::first_named(&args.logs));
    let given = Given::read(args.vehicle.as_deref())?;
    let about = about(args)?;
    // The log is opened before the folder is created, so that a log that can't be read leaves no empty folder behind.
    let mut player = Player::open(&files)?;
    let inputs = files.iter().chain(&given.files).chain(&args.about).cloned();
    let [html_file, pdf_file, json_file] = claimed(args, inputs)?;
    let (text, vehicle) = given.or_attached(player.info(), &player.losses(), log)?;
    let utc_of_zero_s = page::utc_of_zero_s(&player.info().metadata);
    let dive = Assembly::of(&vehicle, &text).kept(true).assemble()?;
    player.connect(dive.armed.sources());
    let mut wall = Wall::new(&dive.armed);
    let program = concat!("headrace ", env!("CARGO_PKG_VERSION")).to_owned();
    // Date and identity are set after the replay, from which they follow.
    let info = FileInfo { title: about.title(), program, date: None, id: [0; 16] };
    let mut collector = Collector::new(&args.output, &info)?;
    let feed = (&mut player as _, Pace::default());
    let threads = args.threads.of_replay();
    let mut report = dive.run_on(threads, feed, &mut Watch::quiet(), &mut |dive| {
        wall.take(dive);
        collector.take(dive);
    })?;
    collector.finish(&args.output)?;
    note_losses(&mut report, log, &player);
    state_utc(&mut report, utc_of_zero_s);
    let delivery =
        Delivery { about: &about, report: &report, wall: &wall, every_m: args.every, vehicle: &vehicle.name };
    let document = delivery.document();
    files::write(&html_file, html(&document).as_bytes())?;
    let pdf = pdf(&document);
    files::write(&pdf_file, &pdf.bytes)?;
    files::write_json(&json_file, &report)?;
    collect::write_files(&args.output, &info, &delivery)?;
    say(&format!("report {}, {} and {}", html_file.display(), pdf_file.display(), json_file.display()));
    if !pdf.unknown.is_empty() {
        let letters: String = pdf.unknown.iter().collect();
        say(&format!(
            "the PDF shows question marks for {letters}, which its font lacks; print the HTML instead"
        ));
    }
    for loss in report.log.iter().flat_map(|log| &log.losses) {
        say(&format!("LOST: {loss}"));
    }
    Ok(exit_code(&report))
}

/// Creates the folder, and claims its files.
fn claimed(args: &Deliver, inputs: impl IntoIterator<Item = PathBuf>) -> Result<[PathBuf; 3], Failure> {
    let folder = &args.output;
    let is_empty = || folder.read_dir().is_ok_and(|mut entries| entries.next().is_none());
    if folder.exists() && !args.overwrite.force && !is_empty() {
        return Err(Failure::Usage(format!(
            "writing {}: it isn't an empty folder; give another name, or overwrite its files with --force",
            folder.display()
        )));
    }
    outputs::folder(folder)?;
    let files = FILES.map(|name| folder.join(name));
    let mut claims = Claims::reading(inputs, &args.overwrite);
    for file in files.iter().cloned().chain(collect::FILES.map(|name| folder.join(name))) {
        claims.claim("-o", &file, Kind::Delivered)?;
    }
    Ok(files)
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
