//! The paper's tables as text.

use crate::paper::{
    AtBothSpeeds, Cell, Combined, CombinedRow, Digits, ModeRow, Note, OneHeadRow, OverlapRow,
    SeveralHeadsRow, Table, Tables,
};

/// Maximum line length of the notes, characters.
const WIDTH: usize = 108;

/// Formats all five tables.
pub fn words(tables: &Tables) -> String {
    let mut text = format!(
        "As printed in {}, and ours; % is by how much ours is larger.\n\
         = the printed digits are ours rounded and ours truncated, r rounded only, t truncated only.\n\
         A letter refers to a note below the table.\n",
        tables.source
    );
    let at = |speed_mps: f64| format!("at {speed_mps} m/s");
    let (stated, fitting) = (at(tables.stated_speed_mps), at(tables.fitting_speed_mps));
    show(&mut text, &tables.table_1, &[(overlap_head(), &overlap)]);
    show(&mut text, &tables.table_2, &[(mode_head(), &mode)]);
    show(&mut text, &tables.table_3, &[(one_head_head(), &one_head)]);
    show(&mut text, &tables.table_4, &[(along_head(&stated, &fitting), &along), (across_head(), &across)]);
    let phase_shift = |row: &CombinedRow| combined(row, &row.phase_shift);
    let sector_offset = |row: &CombinedRow| combined(row, &row.sector_offset);
    let blocks: [Block<'_, CombinedRow>; 2] =
        [(combined_head("phase shift"), &phase_shift), (combined_head("sector offset"), &sector_offset)];
    show(&mut text, &tables.table_5, &blocks);
    text
}

/// Header lines of a block of columns, and a function that formats a row.
type Block<'a, Row> = (String, &'a dyn Fn(&Row) -> String);

/// Appends a table: its title, the rows once for each block of columns, and the notes.
fn show<Row>(text: &mut String, table: &Table<Row>, blocks: &[Block<'_, Row>]) {
    let mut line = |words: &str| {
        text.push_str(words.trim_end());
        text.push('\n');
    };
    line(&format!("\nTable {}. {}", table.number, table.title));
    for (head, row_in_words) in blocks {
        head.lines().for_each(&mut line);
        for row in &table.rows {
            line(&row_in_words(row));
        }
    }
    for words in table.notes.iter().flat_map(wrapped) {
        line(&words);
    }
}

/// Formats a note as lines of limited length.
fn wrapped(note: &Note) -> Vec<String> {
    let mut lines = vec![format!("  {}  {}:", note.mark, note.kind.as_str())];
    for word in note.text.split(' ') {
        match lines.last_mut() {
            Some(last) if last.len() + 1 + word.len() <= WIDTH => {
                last.push(' ');
                last.push_str(word);
            }
            _ => lines.push(format!("     {word}")),
        }
    }
    lines
}

/// A line that consists of `before` and the titles of column groups, each `width` characters wide.
fn titles(before: &str, groups: &[&str], width: usize) -> String {
    groups.iter().fold(before.to_owned(), |line, group| format!("{line}  {group:<0$}", width - 2))
}

/// A line that consists of `before` and the column headings of a group, repeated for each of `count` groups.
fn heads(before: &str, group: &str, count: usize) -> String {
    format!("{before}{}", group.repeat(count))
}

fn overlap_head() -> String {
    let top = titles("          ", &["600 kHz, beam 2.4 deg", "1 MHz, beam 1.4 deg"], CELL.len());
    format!("{top}\n{}", heads("  step deg", CELL, 2))
}

fn overlap(row: &OverlapRow) -> String {
    format!("{:>10}{}{}", row.step_deg, cell(&row.overlap_600_khz, 3), cell(&row.overlap_1_mhz, 3))
}

fn mode_head() -> String {
    let top = titles("                          ", &["samples a turn", "samples a second"], CELL.len());
    format!("{top}\n{}", heads("  mode    step deg  turn s", CELL, 2))
}

fn mode(row: &ModeRow) -> String {
    let (turn, rate) = (cell(&row.samples_per_turn, 0), cell(&row.ping_rate_hz, 3));
    format!("  {:<8}{:>8}{:>8}{turn}{rate}", row.mode, row.step_deg, row.period_s)
}

fn one_head_head() -> String {
    let top = titles("          ", &["T_x", "mean T_y", "T_ymin", "T_ymax"], CELL.len());
    format!("{top}\n{}", heads("  mode    ", CELL, 4))
}

fn one_head(row: &OneHeadRow) -> String {
    let cells = [row.t_x_m, row.t_y_mean_m, row.t_y_min_m, row.t_y_max_m].map(|one| cell(&one, 4));
    format!("  {:<8}{}", row.mode, cells.concat())
}

fn along_head(stated: &str, fitting: &str) -> String {
    let width = PAPER.len() + 2 * OURS.len();
    let top = titles("           ", &["T_x / s, phase shift", "2 T_x / s, sector offset"], width);
    let speeds = titles(&" ".repeat(PAPER.len()), &[stated, fitting], OURS.len()).repeat(2);
    let columns = heads("  mode    s", &format!("{PAPER}{OURS}{OURS}"), 2);
    format!("{top}\n           {speeds}\n{columns}")
}

fn along(row: &SeveralHeadsRow) -> String {
    let both = |at: &AtBothSpeeds| {
        let (stated, fitting) = (&at.at_stated_speed, &at.at_fitting_speed);
        format!("{:>7}{}{}", stated.printed, ours(stated, 4), ours(fitting, 4))
    };
    format!("  {:<8}{}{}{}", row.mode, row.heads, both(&row.phase_t_x_m), both(&row.sector_t_x_m))
}

fn across_head() -> String {
    let top = titles("           ", &["mean T_y", "T_ymin", "T_ymax"], CELL.len());
    format!("{top}\n{}", heads("  mode    s", CELL, 3))
}

fn across(row: &SeveralHeadsRow) -> String {
    let cells = [row.t_y_mean_m, row.t_y_min_m, row.t_y_max_m].map(|one| cell(&one, 4));
    format!("  {:<8}{}{}", row.mode, row.heads, cells.concat())
}

fn combined_head(layout: &str) -> String {
    let top = titles("           ", &["mean T", "T_min", "T_max"], COMBINED.len());
    format!("  {layout}; pred.: predicted by the baseline\n{top}\n{}", heads("  mode    s", COMBINED, 3))
}

/// Headings of the columns from the experiments and of the predicted columns.
const COMBINED: &str = "  paper   ours     %  pred.     %";

fn combined(row: &CombinedRow, layout: &Combined) -> String {
    let cells = layout.cells().map(|both| {
        let (experiment, predicted) = (&both.from_experiment, &both.predicted);
        format!(
            "{:>7}{:>7.4}{:>6}{}{:>6.3}{:>6}",
            experiment.printed,
            experiment.ours,
            percent(experiment),
            sign(experiment),
            predicted.ours,
            percent(predicted)
        )
    });
    format!("  {:<8}{}{}", row.mode, row.heads, cells.concat())
}

const PAPER: &str = "  paper";
const OURS: &str = "    ours      %  ";
const CELL: &str = "  paper    ours      %  ";

fn cell(cell: &Cell, decimals: usize) -> String {
    format!("{:>7}{}", cell.printed, ours(cell, decimals))
}

/// A cell's recomputed value, its difference from the printed one, and the mark of its note.
fn ours(cell: &Cell, decimals: usize) -> String {
    format!("{:>8.decimals$}{:>7} {}", cell.ours, percent(cell), sign(cell))
}

/// The difference in percent, with about three digits.
fn percent(cell: &Cell) -> String {
    match cell.difference_percent {
        None => "-".to_owned(),
        Some(percent) if percent.abs() < 0.005 => "0.00".to_owned(),
        Some(percent) if percent.abs() < 9.995 => format!("{percent:+.2}"),
        Some(percent) => format!("{percent:+.1}"),
    }
}

/// The mark of the note on a cell. For a cell without a note, the mark states how the printed digits follow from the
/// recomputed value.
fn sign(cell: &Cell) -> char {
    cell.note.unwrap_or(match cell.digits {
        Digits::Both => '=',
        Digits::Rounded => 'r',
        Digits::Truncated => 't',
        Digits::Neither => ' ',
    })
}
