//! Chapters of the report.

use headrace_coverage::Verdict;
use headrace_monitor::pilot_text::station;
use headrace_monitor::report::{LogReport, NotInspectedReport, Report};

use super::tables::{self, metres};
use super::wall::Wall;
use super::{figures, measured};
use crate::document::{Block, Document, Table};

/// Maximum number of rows in the table of verdicts by chainage.
const MOST_ROWS: usize = 400;

/// Facts about a dive that its log doesn't contain. The report leaves out facts that are `None`.
#[derive(Debug, Clone, Default)]
pub struct About {
    /// Name of the plant.
    pub plant: Option<String>,
    /// Name of the tunnel.
    pub tunnel: Option<String>,
    /// Client of the inspection.
    pub client: Option<String>,
    /// Date of the dive, as the crew states it.
    pub date: Option<String>,
    /// Names of the crew.
    pub crew: Option<String>,
}

impl About {
    /// Title of the delivery, with plant and tunnel if they are stated.
    pub fn title(&self) -> String {
        let places: Vec<&str> =
            [&self.plant, &self.tunnel].into_iter().flatten().map(String::as_str).collect();
        match places.as_slice() {
            [] => "Sonar inspection".to_owned(),
            places => format!("Sonar inspection: {}", places.join(", ")),
        }
    }
}

/// Data for the report.
pub struct Delivery<'a> {
    /// Facts that the log doesn't contain.
    pub about: &'a About,
    /// Results of the dive.
    pub report: &'a Report,
    /// The measured wall.
    pub wall: &'a Wall,
    /// Distance between cross-sections, m; `None` chooses a distance that suits the length of the inspected tunnel.
    pub every_m: Option<f64>,
    /// Name of the vehicle, from the vehicle file.
    pub vehicle: &'a str,
}

impl Delivery<'_> {
    /// Returns the report as a document.
    pub fn document(&self) -> Document {
        let Self { about, report, wall, .. } = self;
        let extent = report.coverage_extent;
        let mut blocks = self.cover();
        blocks.push(Block::PageBreak);
        if let (Some(from_m), Some(to_m)) = (extent.from_m, extent.to_m) {
            let extent_m = [from_m, to_m];
            blocks.extend(inspected(report, wall, extent_m));
            blocks.extend(missed(report));
            blocks.extend(coverage(report, wall, extent_m));
            blocks.extend(measured::chapter(report, wall, extent_m, self.every_m));
        }
        blocks.extend(sensors(report));
        blocks.extend(self.settings());
        blocks.extend(unknown(report));
        numbered(&mut blocks);
        Document { title: about.title(), footer: format!("Digest {}", report.digest), blocks }
    }

    fn cover(&self) -> Vec<Block> {
        let Self { about, report, .. } = self;
        let stated = [
            ("Plant", &about.plant),
            ("Tunnel", &about.tunnel),
            ("Client", &about.client),
            ("Date", &about.date),
            ("Crew", &about.crew),
        ];
        let mut values: Vec<(String, String)> =
            stated.into_iter().filter_map(|(name, value)| Some((name.to_owned(), value.clone()?))).collect();
        let begun = report.begun_utc.clone().unwrap_or_else(|| {
            "not stated in the log, because the clock of the vehicle's computer was not recorded".to_owned()
        });
        values.push(("Begin of the dive (UTC)".to_owned(), begun));
        values.push(("Vehicle".to_owned(), self.vehicle.to_owned()));
        let extent = report.coverage_extent;
        if let (Some(from_m), Some(to_m)) = (extent.from_m, extent.to_m) {
            let text = format!("{} to {}, {}", station(from_m), station(to_m), metres(extent.length_m));
            values.push(("Coverage extent".to_owned(), text));
        }
        values.push(("Target".to_owned(), format!("no hole larger than {} m", report.target_m)));
        let sum = &report.summary;
        let open = (sum.open_m > 0.0).then_some(("Open", sum.open_m));
        let sums = [
            ("Passed", sum.pass_m),
            ("Missed", sum.fail_m),
            ("No verdict", sum.cannot_say_m),
            ("Not inspected", sum.not_inspected_m),
        ];
        for (name, length_m) in sums.into_iter().chain(open) {
            values.push((name.to_owned(), metres(length_m)));
        }
        let mut blocks = vec![Block::Values(values)];
        blocks.extend(report.not_inspected.as_ref().map(|why| Block::Warning(no_inspection(why))));
        if report.lost_data() {
            blocks.push(Block::Warning(
                "Data of this dive were lost. The chapter on sensors and data lists the losses.".to_owned(),
            ));
        }
        blocks
    }

    fn settings(&self) -> Vec<Block> {
        let report = self.report;
        let dive = &report.dive;
        let sound = format!("{:.1} to {:.1} m/s", dive.sound_speed_least_mps, dive.sound_speed_most_mps);
        let mut values = vec![
            ("Target", metres_or_more(report.target_m)),
            ("Length of a section", metres_or_more(report.section_m)),
            ("Confidence", format!("{} standard deviations of the hole", report.confidence_sd)),
            ("Speed of sound used", sound),
            ("Duration of the dive", format!("{:.0} s", dive.duration_s)),
            ("Program", report.program.to_owned()),
            ("Version of the report's data", report.report_version.to_string()),
            ("Digest of the results", report.digest.clone()),
        ];
        if let Some(LogReport { path, sha256, messages, .. }) = &report.log {
            values.push(("Log", path.clone()));
            values.push(("SHA-256 of the log", sha256.clone()));
            values.push(("Messages in the log", messages.to_string()));
        }
        let values = values.into_iter().map(|(name, value)| (name.to_owned(), value)).collect();
        let mut blocks = vec![heading("Settings and versions"), Block::Values(values)];
        let parts = report.log.iter().flat_map(|log| &log.parts);
        let rows: Vec<Vec<String>> = parts
            .map(|part| vec![part.path.clone(), part.messages.to_string(), part.sha256.clone()])
            .collect();
        if !rows.is_empty() {
            let columns = ["file of the log", "messages", "SHA-256"].map(str::to_owned).to_vec();
            blocks.push(Block::Table(Table { columns, rows }));
        }
        blocks
    }
}

fn metres_or_more(value_m: f64) -> String {
    format!("{value_m} m")
}

fn heading(text: &str) -> Block {
    Block::Heading(text.to_owned())
}

fn paragraph(text: &str) -> Block {
    Block::Paragraph(text.to_owned())
}

/// Numbers the chapters' headings.
fn numbered(blocks: &mut [Block]) {
    let headings = blocks.iter_mut().filter_map(|block| match block {
        Block::Heading(text) => Some(text),
        _ => None,
    });
    for (number, text) in (1..).zip(headings) {
        *text = format!("{number} {text}");
    }
}

fn no_inspection(why: &NotInspectedReport) -> String {
    let reason = match why.reason {
        "no_sonar" => "no profiling sonar gave a return",
        "no_position" => "the vehicle never had a position",
        "outside_tunnel" => "the heads were outside the tunnel",
        _ => "most pings had no position",
    };
    format!("This dive is no inspection: {reason}.")
}

fn inspected(report: &Report, wall: &Wall, extent_m: [f64; 2]) -> Vec<Block> {
    let target_m = report.target_m;
    vec![
        heading("Inspected tunnel"),
        Block::Paragraph(format!(
            "The wall passes where the largest circle without a sample has a diameter of at most {target_m} m, with a \
             confidence of {} standard deviations. There, any feature of at least this size was hit by the sonar at least \
             once. Smaller features may have been missed anywhere.",
            report.confidence_sd
        )),
        Block::Figure(
            figures::inspected(report, &wall.profile, extent_m),
            "The unrolled wall by chainage and clock position, seen along the tunnel from the portal. White circles: largest \
             hole of each stretch that is still missed. Black dots: empty squares of the survey grid. Dashed outlines: \
             declared openings, which have no verdict."
                .to_owned(),
        ),
        Block::Table(tables::verdicts(report)),
    ]
}

fn missed(report: &Report) -> Vec<Block> {
    let mut blocks = vec![heading("Missed stretches")];
    if report.runs.is_empty() {
        blocks.push(paragraph("No stretch was missed."));
    } else {
        blocks.push(paragraph(
            "A stretch counts as refilled when a later pass has filled its holes. Times are seconds since the dive's first \
             packet.",
        ));
        blocks.push(Block::Table(tables::missed(report)));
    }
    blocks.push(Block::Subheading("Stretches without a verdict or not inspected".to_owned()));
    if report.no_verdict.is_empty() {
        blocks.push(paragraph("There is none within the coverage extent."));
    } else {
        blocks.push(Block::Table(tables::no_verdict(report)));
    }
    if !report.openings.is_empty() {
        blocks.push(Block::Subheading("Declared openings, which have no verdict".to_owned()));
        blocks.push(Block::Table(tables::openings(report)));
    }
    blocks
}

fn coverage(report: &Report, wall: &Wall, extent_m: [f64; 2]) -> Vec<Block> {
    let survey = &report.survey;
    let share = survey.enough_share.map_or_else(|| tables::NONE.to_owned(), |share| format!("{share:.3}"));
    let size = format!("{:.2} m by {:.2} m", survey.node_m, survey.around_m);
    let values = [
        ("Samples on the wall", report.dive.samples_valid.to_string()),
        ("Size of a survey square", size),
        ("Survey squares", survey.nodes.to_string()),
        ("Share with enough samples", share),
        ("Samples that a square needs", survey.enough.to_string()),
        ("Squares without a sample", survey.empty.to_string()),
    ];
    let mut blocks = vec![
        heading("Coverage"),
        Block::Figure(
            figures::density(wall, extent_m),
            "Samples per square metre of wall, by chainage and clock position.".to_owned(),
        ),
        Block::Values(values.into_iter().map(|(name, value)| (name.to_owned(), value)).collect()),
        Block::Subheading("Verdicts by chainage".to_owned()),
    ];
    let by_chainage = tables::by_chainage(report);
    if by_chainage.rows.len() > MOST_ROWS {
        let count = by_chainage.rows.len();
        blocks.push(Block::Paragraph(format!(
            "The verdict changes {count} times: see sections in report.json."
        )));
    } else {
        blocks.push(Block::Table(by_chainage));
    }
    if report.survey.empty as usize > report.survey.holidays.len() {
        let listed = report.survey.holidays.len();
        blocks.push(Block::Paragraph(format!("The first figure shows the first {listed} empty squares.")));
    }
    blocks
}

fn sensors(report: &Report) -> Vec<Block> {
    let mut blocks = vec![heading("Sensors and data"), Block::Table(tables::sensors(report))];
    let losses: Vec<String> = report.log.iter().flat_map(|log| &log.losses).cloned().collect();
    blocks.push(Block::Subheading("Lost data".to_owned()));
    if losses.is_empty() {
        let text = if report.lost_data() {
            "The log is whole, but data were lost in the dive: see the tables."
        } else {
            "None."
        };
        blocks.push(paragraph(text));
    } else {
        blocks.push(Block::List(losses));
    }
    let notes: Vec<String> = report.log.iter().flat_map(|log| &log.notes).cloned().collect();
    if !notes.is_empty() {
        blocks.push(Block::Subheading("Irregularities without loss".to_owned()));
        blocks.push(Block::List(notes));
    }
    for (name, table) in [
        ("Pings without a sample", tables::rejected(report)),
        ("Times without a position", tables::position_gaps(report)),
        ("Notes of the crew", tables::notes(report)),
    ] {
        if !table.rows.is_empty() {
            blocks.push(Block::Subheading(name.to_owned()));
            blocks.push(Block::Table(table));
        }
    }
    blocks
}

/// Chapter on everything that the dive leaves unknown.
fn unknown(report: &Report) -> Vec<Block> {
    let sum = &report.summary;
    let mut items = vec![format!(
        "Features smaller than {} m, which may lie between the samples of wall that passed.",
        report.target_m
    )];
    for (length_m, what) in [
        (sum.fail_m, figures::word(Verdict::Fail)),
        (sum.cannot_say_m, "without a verdict"),
        (sum.not_inspected_m, "not inspected"),
        (sum.open_m, "still open at the end of the dive"),
    ] {
        if length_m > 0.0 {
            items.push(format!("The state of {} of tunnel that is {what}.", metres(length_m)));
        }
    }
    items.push("The tunnel beyond the coverage extent.".to_owned());
    if !report.openings.is_empty() {
        items.push("The wall in and behind declared openings.".to_owned());
    }
    if report.begun_utc.is_none() {
        items
            .push("Date and time of the dive by the program, because its clock was not recorded.".to_owned());
    }
    if report.lost_data() {
        items.push("The content of the lost data.".to_owned());
    }
    items.push(
        "Material, cracks and condition of the wall, because the sonar measures distances only.".to_owned(),
    );
    items.push(
        "Positions of features more exactly than the vehicle's estimate of its own position.".to_owned(),
    );
    let mut blocks = vec![
        heading("Limits of the inspection"),
        paragraph("The following is not known after this dive:"),
        Block::List(items),
    ];
    let doubts: Vec<String> = report
        .alert_list
        .iter()
        .filter(|alert| alert.occurrences.is_some())
        .map(|alert| format!("{}: {}", alert.text, alert.advice))
        .map(|text| text.trim_end_matches([':', ' ']).to_owned())
        .collect();
    if !doubts.is_empty() {
        blocks.push(Block::Subheading("Doubts about sensors and settings".to_owned()));
        blocks.push(Block::List(doubts));
    }
    blocks
}
