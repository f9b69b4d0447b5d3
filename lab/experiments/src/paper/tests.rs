use headrace_geometry::math;
use headrace_sampling::section;

use super::drift::Rig;
use super::findings::{Place, corner_step_m, fitting_place};
use super::printed::lines;
use super::*;

fn tables() -> Tables {
    super::tables().unwrap()
}

/// Names of cells whose printed digits follow neither from rounding nor from truncation.
fn apart<'a>(cells: impl IntoIterator<Item = (String, &'a Cell)>) -> Vec<String> {
    let cells = cells.into_iter();
    cells.filter(|(_, cell)| cell.digits == Digits::Neither).map(|(name, _)| name).collect()
}

/// Names of cells whose printed digits follow from truncation but not from rounding.
fn truncated<'a>(cells: impl IntoIterator<Item = &'a Cell>) -> Vec<f64> {
    let cells = cells.into_iter().filter(|cell| cell.digits == Digits::Truncated);
    cells.map(|cell| cell.printed.value()).collect()
}

#[test]
fn printed_digits_are_recognised_as_rounded_or_truncated() {
    let digits = |text: &str, ours| Printed::parse(text).unwrap().digits_of(ours);
    assert_eq!(digits("1.55", 1.4 / 0.9), Digits::Truncated);
    assert_eq!(digits("2.67", 2.4 / 0.9), Digits::Rounded);
    assert_eq!(digits("2.33", 1.4 / 0.6), Digits::Both);
    assert_eq!(digits("8", 8.0), Digits::Both);
    // The recomputed value is just below 0.784.
    assert_eq!(digits("0.784", 0.784 - 1e-12), Digits::Both);
    assert_eq!(digits("0.784", 0.785 - 1e-12), Digits::Neither);
    assert_eq!(digits("0.784", 0.783_499), Digits::Neither);
    assert_eq!(digits("0.05", 0.0545), Digits::Both);
    for text in ["", "-", "1,2", "nan", "inf", "0.1234567"] {
        assert_eq!(Printed::parse(text), None, "{text:?}");
    }
    assert_eq!(format!("{:>7}", Printed::parse("0.230").unwrap()), "  0.230");
}

#[test]
fn recomputed_table_1_matches_to_the_digit() {
    let table = tables().table_1;
    let expected = [[8.0, 4.67], [4.0, 2.33], [2.67, 1.55], [2.0, 1.16], [1.0, 0.0]];
    let printed =
        |row: &OverlapRow| [row.overlap_600_khz, row.overlap_1_mhz].map(|cell| cell.printed.value());
    assert_eq!(table.rows.iter().map(printed).collect::<Vec<_>>(), expected);
    let cells = || table.rows.iter().flat_map(|row| [&row.overlap_600_khz, &row.overlap_1_mhz]);
    // The printed 0 could be 0.58 truncated to an integer, but it is still an erratum.
    assert_eq!(truncated(cells()), [1.55, 1.16, 0.0]);
    assert_eq!(apart(cells().map(|cell| (cell.printed.to_string(), cell))), [""; 0]);
    let none = table.rows[4].overlap_1_mhz;
    assert!((none.ours - 0.583_333).abs() < 1e-6);
    assert_eq!((none.difference_percent, none.note), (None, Some('a')));
}

#[test]
fn recomputed_table_2_matches_to_the_digit() {
    let table = tables().table_2;
    assert_eq!(table.rows.len(), 5);
    let cells = || table.rows.iter().flat_map(|row| [&row.samples_per_turn, &row.ping_rate_hz]);
    assert_eq!(apart(cells().map(|cell| (cell.printed.to_string(), cell))), [""; 0]);
    assert_eq!(truncated(cells()), [55.55, 55.55]);
}

#[test]
fn t_x_matches_the_paper_except_in_mode_fast_if_the_speed_is_fitted() {
    let tables = tables();
    let one = tables.table_3.rows.iter().map(|row| (row.mode.to_owned(), &row.t_x_m));
    assert_eq!(apart(one), ["FAST"]);

    let several = || tables.table_4.rows.iter().flat_map(|row| [&row.phase_t_x_m, &row.sector_t_x_m]);
    assert_eq!(several().count(), 30);
    let fitting = || several().map(|cell| &cell.at_fitting_speed);
    assert_eq!(apart(fitting().map(|cell| (cell.printed.to_string(), cell))), [""; 0]);
    assert_eq!(truncated(fitting()), [2.116]);
    let stated = several().map(|cell| (cell.at_stated_speed.printed.to_string(), &cell.at_stated_speed));
    assert_eq!(apart(stated).len(), 30);

    let Interval { low, high } = tables.consistent_speed_mps;
    assert!((low - 0.195_995).abs() < 1e-6 && (high - 0.196_019).abs() < 1e-6, "{low} to {high}");
    assert!(low < FITTING_SPEED_MPS && FITTING_SPEED_MPS < high);
}

#[test]
fn printed_mean_steps_are_consistent_with_one_perimeter() {
    let tables = tables();
    let one = tables.table_3.rows.iter().map(|row| (row.mode.to_owned(), &row.t_y_mean_m));
    assert_eq!(apart(one), ["SLOW", "FAST", "FASTER", "FASTEST"]);
    let Interval { low, high } = tables.consistent_perimeter_m;
    assert!((low - 34.425).abs() < 1e-9 && (high - 34.5).abs() < 1e-9, "{low} to {high}");
    // For any perimeter in the interval, the means of all rows that aren't copies match to the digit.
    for perimeter_m in [low + 1e-6, high - 1e-6] {
        for line in lines(3).into_iter().chain(lines(4)) {
            let (mode, heads) = (line.text("mode").unwrap(), line.heads().unwrap());
            let row = tables.table_2.rows.iter().find(|row| row.mode == mode).unwrap();
            let steps = u32::try_from(math::round_to_i64(row.samples_per_turn.ours)).unwrap();
            let mean_m = section::t_yp_m(perimeter_m, steps).unwrap();
            let rounded = line.printed("base_ty_mean").unwrap().digits_of(mean_m).rounded();
            assert_eq!(rounded, mode != "FAST" || heads < 3, "{mode} x {heads}: {mean_m}");
        }
    }
}

/// The head positions in the notes give each printed extreme by Eq. 5 and 6, except for errata.
#[test]
fn fitted_head_positions_give_the_printed_extremes() {
    let mut misses = Vec::new();
    for line in lines(3).into_iter().chain(lines(4)) {
        let (mode, heads) = (line.text("mode").unwrap(), line.heads().unwrap());
        let place = fitting_place(Rig::of(heads));
        let steps = lines(2).into_iter().find(|line| line.text("mode").unwrap() == mode).unwrap();
        let step_rad = steps.printed("step_deg").unwrap().value().to_radians();
        let min_m = section::t_y1_m(place.floor_m, step_rad).unwrap();
        let max_m = corner_step_m(place, step_rad);
        for (column, ours_m) in [("base_ty_min", min_m), ("base_ty_max", max_m)] {
            let printed = line.printed(column).unwrap();
            if !printed.digits_of(ours_m).rounded() {
                misses.push(format!("{mode} x {heads} {column} {printed}: {ours_m:.3}"));
            }
        }
    }
    assert_eq!(
        misses,
        [
            "SLOW x 1 base_ty_max 0.014: 0.103",
            "FASTEST x 1 base_ty_min 0.100: 0.105",
            "FASTEST x 2 base_ty_min 0.100: 0.109",
            "FAST x 3 base_ty_min 0.055: 0.041",
            "FAST x 3 base_ty_max 0.399: 0.303",
            "FAST x 4 base_ty_min 0.055: 0.041",
            "FAST x 4 base_ty_max 0.399: 0.303",
        ]
    );
}

/// The largest chord by ray casting equals Eq. 6 with the last step in the farther corner. Yaw increases the distance
/// of that corner.
#[test]
fn largest_step_is_at_the_corner() {
    let table = tables().table_3;
    // Height of the head: the blueprint's mid-height minus 1.65 m. Distance of the corner: half the base plus 1.5 m,
    // seen at 15 degrees of yaw.
    let aside_m = 6.449_655 / math::cos(15_f64.to_radians());
    let place = Place { floor_m: 2.701_094, aside_m };
    for (row, step_deg) in table.rows.iter().zip([0.3_f64, 0.6, 0.9, 1.2, 2.4]) {
        let share = row.t_y_max_m.ours / corner_step_m(place, step_deg.to_radians());
        assert!((0.998..1.000_001).contains(&share), "{}: {share}", row.mode);
    }
}

#[test]
fn table_5_follows_from_the_experiments_of_table_4() {
    let table = tables().table_5;
    let layouts = table.rows.iter().flat_map(|row| [row.phase_shift, row.sector_offset]);
    let cells: Vec<Cell> =
        layouts.flat_map(|layout| layout.cells()).map(|cell| cell.from_experiment).collect();
    assert_eq!(cells.len(), 90);
    assert!(cells.iter().all(|cell| cell.digits.rounded()));
    for (line, experiment) in lines(5).iter().zip(lines(4)) {
        for column in ["mode", "heads"] {
            assert_eq!(line.text(column).unwrap(), experiment.text(column).unwrap());
        }
    }
}

#[test]
fn differing_cells_refer_to_existing_notes() {
    let tables = tables();
    let marks = |notes: &[Note]| notes.iter().map(|note| note.mark).collect::<String>();
    assert_eq!(marks(&tables.table_3.notes), "abcde");
    assert_eq!(marks(&tables.table_4.notes), "abcde");
    let cells = tables.table_3.rows.iter().flat_map(|r| [r.t_x_m, r.t_y_mean_m, r.t_y_min_m, r.t_y_max_m]);
    let several = tables.table_4.rows.iter().flat_map(|r| {
        let along = [r.phase_t_x_m, r.sector_t_x_m].map(|t| [t.at_stated_speed, t.at_fitting_speed]);
        along.into_iter().flatten().chain([r.t_y_mean_m, r.t_y_min_m, r.t_y_max_m])
    });
    for cell in cells.chain(several) {
        // The printed 2.116 is the pass distance T_x of mode SLOW with two heads.
        let cut = cell.digits == Digits::Truncated && cell.printed.to_string() == "2.116";
        assert_eq!(cell.note.is_none(), cell.digits.rounded() || cut, "{cell:?}");
        assert!(cell.note.is_none_or(|mark| ('a'..='e').contains(&mark)));
    }
}

#[test]
fn every_csv_file_of_printed_numbers_names_its_source() {
    for (number, text) in [
        include_str!("table1.csv"),
        include_str!("table2.csv"),
        include_str!("table3.csv"),
        include_str!("table4.csv"),
        include_str!("table5.csv"),
    ]
    .into_iter()
    .enumerate()
    {
        let first = text.lines().next().unwrap();
        let source = "# Jorge et al., Sensors 2021, 21, 1900, CC BY 4.0, Table ";
        assert_eq!(first, format!("{source}{}", number + 1));
    }
}
