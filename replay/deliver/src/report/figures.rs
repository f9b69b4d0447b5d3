//! Figures of the report. They are legible in black and white: tones differ in lightness, and patterns mark sections
//! without a verdict.

use headrace_coverage::Verdict;
use headrace_geometry::math;
use headrace_geometry::tunnel::Profile;
use headrace_monitor::pilot_text::station;
use headrace_monitor::report::{OpeningReport, Report};
use headrace_monitor::section_row::SectionRow;
use headrace_monitor::words::{NOT_INSPECTED, verdict_words};

use super::wall::{Cell, SECTORS, Wall};
use crate::pictures::canvas::{BOLD, Canvas, NORMAL, SMALL, Side, width_px};
use crate::pictures::chart::{Axis, Chart};
use crate::pictures::clock;
use crate::pictures::look::{AXIS, BLACK, Colour, GRID, LEADER, Look, TARGET, WHITE, of_several};
use crate::pictures::polyline::{Frame, Px};
use crate::pictures::shape::Drawing;

const WIDTH_PX: u32 = 700;
/// Left and right ends of the charts over chainage.
const ENDS_PX: [f64; 2] = [58.0, 614.0];
/// Largest length of tunnel that a map shows in a single strip, m.
const STRIP_M: f64 = 80.0;
const MOST_STRIPS: u32 = 4;
/// Height of a strip's axis.
const AXIS_PX: f64 = 50.0;
/// Height of the legend above the strips.
const LEGEND_PX: f64 = 34.0;
/// Least width of a missed section. Nobody would see a narrower one.
const LEAST_PX: f64 = 1.5;
/// Least width of a map's cell, pixels.
const CELL_PX: f64 = 2.0;
/// Least length of a map's cell, m. A cell has at least one section.
const CELL_M: f64 = 0.5;
/// Number of clock sectors in half an hour, the width of a map's cell.
const CELL_SECTORS: usize = 4;
const OUTLINE: Look = Look { colour: BLACK, ..AXIS };

/// Tone and pattern of a verdict.
#[derive(Clone, Copy, PartialEq)]
struct Tone {
    words: &'static str,
    ground: Colour,
    /// Direction of the lines drawn over the tone; 0 without lines.
    hatched: i8,
}

const NOT_SEEN: Tone = Tone { words: NOT_INSPECTED, ground: WHITE, hatched: 1 };

fn tone(section: &SectionRow) -> Tone {
    if section.not_inspected { NOT_SEEN } else { verdict_tone(section.verdict) }
}

/// Word that the report uses for a verdict.
pub(super) fn word(verdict: Verdict) -> &'static str {
    if verdict == Verdict::CannotSay { "no verdict" } else { verdict_words(verdict) }
}

/// Word that the report uses for a section.
pub(super) fn section_word(row: &SectionRow) -> &'static str {
    if row.not_inspected { NOT_INSPECTED } else { word(row.verdict) }
}

fn verdict_tone(verdict: Verdict) -> Tone {
    let (ground, hatched) = match verdict {
        Verdict::Pass => (Colour(212, 232, 222), 0),
        Verdict::Fail => (Colour(176, 58, 0), 0),
        Verdict::CannotSay => (Colour(245, 205, 110), -1),
        Verdict::Open => (Colour(190, 190, 190), 0),
    };
    Tone { words: word(verdict), ground, hatched }
}

/// Charts of the unrolled wall, one below the other, that together show a range of chainage.
fn strips(
    canvas: &Canvas,
    profile: &Profile,
    [from_m, to_m]: [f64; 2],
    mut draw: impl FnMut(&Chart<'_>, [f64; 2]),
) {
    let count = strip_count(to_m - from_m);
    let length_m = (to_m - from_m) / f64::from(count);
    let height_px = strip_px(count);
    for number in 0..count {
        let ends_m = [f64::from(number), f64::from(number + 1)].map(|place| from_m + place * length_m);
        let top = LEGEND_PX + f64::from(number) * (height_px + AXIS_PX);
        let frame = Frame { left: ENDS_PX[0], top, right: ENDS_PX[1], bottom: top + height_px };
        let x = Axis::new("chainage from the portal, m", ends_m[0], ends_m[1], 10).with_name_at(32.0);
        let y = Axis::new("wall from floor, m", 0.0, profile.perimeter_m(), 4).with_name_at(26.0);
        let chart = Chart::new(canvas, frame, &x, &y);
        draw(&chart, ends_m);
        let [left, right] = ENDS_PX;
        let corners = [[left, top], [right, top], [right, frame.bottom], [left, frame.bottom], [left, top]];
        canvas.line(&corners, &OUTLINE);
        for hour in clock::hours(profile).iter().filter(|hour| !hour.place.is_empty()) {
            let y = chart.px([0.0, hour.arc_m])[1];
            canvas.line(&[[right, y], [right + 4.0, y]], &OUTLINE);
            canvas.text([right + 7.0, y], &hour.words(), Side::Right, SMALL);
        }
    }
}

fn strip_count(length_m: f64) -> u32 {
    (1..MOST_STRIPS).find(|count| length_m <= STRIP_M * f64::from(*count)).unwrap_or(MOST_STRIPS)
}

/// Height of a strip, pixels. If there are fewer strips, each is higher.
fn strip_px(count: u32) -> f64 {
    90.0 + 140.0 / f64::from(count)
}

fn strips_canvas(length_m: f64) -> Canvas {
    let count = strip_count(length_m);
    let height_px = LEGEND_PX + f64::from(count) * (strip_px(count) + AXIS_PX);
    Canvas::untitled([WIDTH_PX, u32::try_from(math::round_to_i64(height_px)).unwrap_or(0)])
}

/// Draws samples of tones with their words, in a line.
fn legend(canvas: &Canvas, entries: &[(Tone, String)]) {
    let mut left = ENDS_PX[0];
    for (tone, words) in entries {
        swatch(canvas, [left, 6.0], [left + 22.0, 18.0], *tone);
        let corners = [[left, 6.0], [left + 22.0, 6.0], [left + 22.0, 18.0], [left, 18.0], [left, 6.0]];
        canvas.line(&corners, &OUTLINE);
        canvas.text([left + 28.0, 12.0], words, Side::Right, NORMAL);
        left += 46.0 + width_px(words, NORMAL);
    }
}

fn swatch(canvas: &Canvas, upper_left: Px, lower_right: Px, tone: Tone) {
    canvas.area(upper_left, lower_right, tone.ground);
    if tone.hatched == 0 {
        return;
    }
    let ([left, top], [right, bottom]) = (upper_left, lower_right);
    let (frame, height) = (Frame { left, top, right, bottom }, bottom - top);
    // The lines are at multiples of their distance on the whole sheet, so that they join across neighbouring areas.
    let step = 6.0;
    let mut x = ((left - height) / step).floor() * step;
    while x < right + height {
        let line = if tone.hatched > 0 {
            [[x, bottom], [x + height, top]]
        } else {
            [[x, top], [x + height, bottom]]
        };
        for piece in frame.cut(&line) {
            canvas.line(&piece, &LEADER);
        }
        x += step;
    }
}

/// Map of chainage and clock position, with the wall that passed, was missed, has no verdict, or was not inspected.
pub(super) fn inspected(report: &Report, profile: &Profile, extent_m: [f64; 2]) -> Drawing {
    let canvas = strips_canvas(extent_m[1] - extent_m[0]);
    let of = |verdict| (verdict_tone(verdict), word(verdict).to_owned());
    let mut entries = [Verdict::Pass, Verdict::Fail, Verdict::CannotSay].map(of).to_vec();
    entries.push((NOT_SEEN, NOT_SEEN.words.to_owned()));
    if report.summary.open_m > 0.0 {
        entries.push(of(Verdict::Open));
    }
    legend(&canvas, &entries);
    strips(&canvas, profile, extent_m, |chart, ends_m| {
        let within = report.sections.iter().filter(|row| row.end_m > ends_m[0] && row.start_m < ends_m[1]);
        let rows: Vec<&SectionRow> = within.collect();
        // Missed sections are drawn last, because a narrow one is drawn wider than it is and would be covered.
        for is_missed in [false, true] {
            for run in rows.chunk_by(|a, b| tone(a) == tone(b)) {
                let (Some(first), Some(last)) = (run.first(), run.last()) else { continue };
                if (first.verdict == Verdict::Fail) == is_missed {
                    band(chart, [first.start_m.max(ends_m[0]), last.end_m.min(ends_m[1])], tone(first));
                }
            }
        }
        holes(chart, report, ends_m);
        let empty = report.survey.holidays.iter().filter(|node| (ends_m[0]..ends_m[1]).contains(&node.x_m));
        let empty: Vec<Px> = empty.map(|node| chart.px([node.x_m, node.arc_m])).collect();
        if !empty.is_empty() {
            chart.canvas.dots(&empty, 2.2, BLACK);
        }
        for opening in &report.openings {
            outline(chart, opening, profile.perimeter_m());
        }
    });
    canvas.finish()
}

fn band(chart: &Chart<'_>, [from_m, to_m]: [f64; 2], tone: Tone) {
    let [left, right] = [from_m, to_m].map(|x_m| chart.px([x_m, 0.0])[0]);
    let right = right.max((left + LEAST_PX).min(chart.frame.right));
    swatch(chart.canvas, [left, chart.frame.top], [right, chart.frame.bottom], tone);
}

/// Draws the largest hole of each stretch that is still missed, in its true size.
fn holes(chart: &Chart<'_>, report: &Report, [from_m, to_m]: [f64; 2]) {
    for run in report.runs.iter().filter(|run| run.cleared_s.is_none()) {
        let is_its = |row: &&SectionRow| row.hole_x_m.is_some_and(|x_m| (x_m - run.hole_x_m).abs() < 1e-9);
        let row = report.sections.iter().find(is_its);
        let Some((x_m, arc_m)) = row.and_then(|row| row.hole_x_m.zip(row.hole_arc_m)) else { continue };
        let radius_m = run.hole_m / 2.0;
        if x_m + radius_m > from_m && x_m - radius_m < to_m {
            let (centre, edge) = (chart.px([x_m, arc_m]), chart.px([x_m + radius_m, arc_m + radius_m]));
            chart.ellipse(centre, [edge[0] - centre[0], centre[1] - edge[1]], WHITE, &OUTLINE);
        }
    }
}

/// Draws the outline of a declared opening.
fn outline(chart: &Chart<'_>, opening: &OpeningReport, perimeter_m: f64) {
    let (from_m, length_m) = opening.arc_from_m.zip(opening.arc_length_m).unwrap_or((0.0, perimeter_m));
    // An opening may extend beyond the end of the perimeter. That part of it begins again at the floor.
    for turn in [0.0, perimeter_m] {
        let [low, high] =
            [from_m - turn, from_m + length_m - turn].map(|arc_m| arc_m.clamp(0.0, perimeter_m));
        if high > low {
            let OpeningReport { from_m, to_m, .. } = *opening;
            let corners = [[from_m, low], [to_m, low], [to_m, high], [from_m, high], [from_m, low]];
            chart.line(&corners, &Look { colour: BLACK, ..TARGET });
        }
    }
}

/// A map of the wall in which a cell is `sectors` clock sectors wide and the colour of a cell shows its class. `class`
/// gives the class of a cell with its area in square metres; a cell without a class stays white.
fn map(
    wall: &Wall,
    extent_m: [f64; 2],
    sectors: usize,
    classes: &[(Colour, String)],
    class: &dyn Fn(Cell, f64) -> Option<usize>,
) -> Drawing {
    let canvas = strips_canvas(extent_m[1] - extent_m[0]);
    let plain =
        |(ground, words): &(Colour, String)| (Tone { words: "", ground: *ground, hatched: 0 }, words.clone());
    legend(&canvas, &classes.iter().map(plain).collect::<Vec<_>>());
    strips(&canvas, &wall.profile, extent_m, |chart, ends_m| {
        let length_m = ends_m[1] - ends_m[0];
        let least_m = cell_m(wall).max(CELL_PX * length_m / (ENDS_PX[1] - ENDS_PX[0]));
        let count = math::round_to_i64((length_m / least_m).floor().max(1.0));
        let x_m = |column: i64| ends_m[0] + length_m * column as f64 / count as f64;
        let mut areas = vec![Vec::new(); classes.len()];
        for first in (0..SECTORS).step_by(sectors) {
            let [low, high] = [first, first + sectors].map(|sector| wall.arc_m(sector as f64));
            let of = |column: i64| {
                let ends_m = [x_m(column), x_m(column + 1)];
                let area_m2 = wall.length_m(ends_m) * (high - low);
                (column, class(wall.cell(ends_m, first, sectors), area_m2))
            };
            let columns: Vec<_> = (0..count).map(of).collect();
            for run in columns.chunk_by(|a, b| a.1 == b.1) {
                let [(from, Some(class)), ..] = *run else { continue };
                let [left, top] = chart.px([x_m(from), high]);
                let [right, bottom] = chart.px([x_m(from + run.len() as i64), low]);
                if let Some(areas) = areas.get_mut(class) {
                    areas.push(([left, top], [right - left, bottom - top]));
                }
            }
        }
        for (areas, (colour, _)) in areas.iter().zip(classes).filter(|(areas, _)| !areas.is_empty()) {
            chart.canvas.areas(areas, *colour);
        }
    });
    canvas.finish()
}

/// Density of samples by chainage and clock position.
pub(super) fn density(wall: &Wall, extent_m: [f64; 2]) -> Drawing {
    const LIMITS_PERM2: [f64; 4] = [5.0, 10.0, 20.0, 50.0];
    let greys = [0, 90, 150, 195, 225, 245].map(|grey| Colour(grey, grey, grey));
    let words = ["none", "below 5", "5 to 10", "10 to 20", "20 to 50", "50 or more per m²"];
    let classes: Vec<_> = greys.into_iter().zip(words.map(str::to_owned)).collect();
    map(wall, extent_m, CELL_SECTORS, &classes, &|cell, area_m2| {
        let density = f64::from(cell.samples) / area_m2;
        Some(if cell.samples == 0 {
            0
        } else {
            1 + LIMITS_PERM2.iter().filter(|limit| density >= **limit).count()
        })
    })
}

/// Deviation of the unrolled wall from the design. Lightness grows from inside to outside.
pub(super) fn deviation(wall: &Wall, extent_m: [f64; 2]) -> Drawing {
    const COLOURS: [Colour; 7] = [
        Colour(0, 34, 78),
        Colour(53, 69, 108),
        Colour(102, 105, 112),
        Colour(148, 144, 132),
        Colour(186, 178, 120),
        Colour(222, 204, 92),
        Colour(254, 234, 120),
    ];
    // The outermost classes begin at 2.5 steps, so they have at most the outermost sixth of the deviations.
    let step_m = round_up(spread_m(wall, extent_m) / 3.0);
    let limit = |number: usize| (number as f64 - 2.5) * step_m;
    let words = |number: usize| match number {
        0 => format!("below {:.3}", limit(0)),
        6 => format!("over {:.3} m", limit(5)),
        _ => format!("{:.2}", (number as f64 - 3.0) * step_m),
    };
    let classes: Vec<_> =
        COLOURS.into_iter().enumerate().map(|(number, colour)| (colour, words(number))).collect();
    map(wall, extent_m, CELL_SECTORS / 2, &classes, &|cell, _| {
        cell.mean_m().map(|mean_m| (0..6).filter(|number| mean_m >= limit(*number)).count())
    })
}

/// Least length of a map's cell, m.
fn cell_m(wall: &Wall) -> f64 {
    CELL_M.max(wall.section_m)
}

/// Largest mean deviation of a cell of least length, inwards or outwards, m.
fn spread_m(wall: &Wall, [from_m, to_m]: [f64; 2]) -> f64 {
    let cell_m = cell_m(wall);
    let count = math::round_to_i64(((to_m - from_m) / cell_m).ceil());
    let mut most_m = 0.01_f64;
    for column in 0..count {
        let x_m = from_m + column as f64 * cell_m;
        for first in (0..SECTORS).step_by(CELL_SECTORS) {
            let mean_m = wall.cell([x_m, x_m + cell_m], first, CELL_SECTORS).mean_m();
            most_m = most_m.max(mean_m.unwrap_or(0.0).abs());
        }
    }
    most_m
}

/// Smallest number that is at least `value` and is 1, 2 or 5 times a power of ten, from 0.01 to 50.
fn round_up(value: f64) -> f64 {
    let steps =
        [0.01, 0.1, 1.0, 10.0].into_iter().flat_map(|decade| [1.0, 2.0, 5.0].map(|factor| factor * decade));
    steps.into_iter().find(|step| *step >= value).unwrap_or(50.0)
}

/// Deviation of crown, left wall, right wall and floor from the design along the tunnel.
pub(super) fn profile(wall: &Wall, extent_m: [f64; 2]) -> Drawing {
    const PLACES: [(&str, usize); 4] = [("crown", 48), ("left wall", 24), ("right wall", 72), ("floor", 0)];
    const HEIGHT_PX: f64 = 118.0;
    let canvas = Canvas::untitled([WIDTH_PX, 530]);
    let step_m = cell_m(wall).max((extent_m[1] - extent_m[0]) / 280.0);
    let count = math::round_to_i64(((extent_m[1] - extent_m[0]) / step_m).ceil());
    let line = |sector: usize| -> Vec<(f64, Option<f64>)> {
        let at = |column: i64| {
            let x_m = extent_m[0] + column as f64 * step_m;
            let cell = wall.cell([x_m, x_m + step_m], sector + SECTORS - CELL_SECTORS / 2, CELL_SECTORS);
            (x_m + step_m / 2.0, cell.mean_m())
        };
        (0..count).map(at).collect()
    };
    let lines = PLACES.map(|(_, sector)| line(sector));
    let most_m =
        lines.iter().flatten().filter_map(|(_, mean_m)| *mean_m).fold(0.05, |most: f64, m| most.max(m.abs()));
    let most_m = round_up(most_m);
    for (number, ((place, _), line)) in PLACES.into_iter().zip(lines).enumerate() {
        let top = 8.0 + number as f64 * (HEIGHT_PX + 4.0);
        let frame = Frame { left: 70.0, top, right: 690.0, bottom: top + HEIGHT_PX - 12.0 };
        let x = Axis::new("chainage from the portal, m", extent_m[0], extent_m[1], 10).with_name_at(32.0);
        let x = if number + 1 == PLACES.len() { x } else { x.bare() };
        let y = Axis::new(&format!("{place}, m"), -most_m, most_m, 4).with_name_at(36.0);
        let chart = Chart::new(&canvas, frame, &x, &y);
        chart.across(0.0, &TARGET);
        for piece in line.split(|(_, mean_m)| mean_m.is_none()) {
            let points: Vec<_> = piece.iter().map(|(x_m, mean_m)| [*x_m, mean_m.unwrap_or(0.0)]).collect();
            // A single place between gaps is drawn as a short line, because nobody would see a point.
            let points = if let [[x_m, m]] = *points {
                vec![[x_m - step_m / 2.0, m], [x_m + step_m / 2.0, m]]
            } else {
                points
            };
            chart.line(&points, &Look { width_px: 1.4, colour: BLACK, ..of_several(0) });
        }
    }
    canvas.finish()
}

/// The section at a chainage, from sections in order.
pub(super) fn row_at(sections: &[SectionRow], x_m: f64) -> Option<&SectionRow> {
    let next = sections.partition_point(|row| row.start_m <= x_m);
    sections.get(next.checked_sub(1)?).filter(|row| x_m < row.end_m)
}

/// Number of cross-sections in a drawing.
pub(super) const SECTIONS_EACH: usize = 12;

/// Cross-sections at up to [`SECTIONS_EACH`] chainages, as measured and as designed. Each shows the samples of
/// the whole sections around its chainage, see [`Wall::around`].
pub(super) fn cross_sections(wall: &Wall, report: &Report, places_m: &[f64]) -> Drawing {
    const COLUMNS: usize = 3;
    const SIZE_PX: [f64; 2] = [700.0 / 3.0, 212.0];
    let rows = places_m.len().div_ceil(COLUMNS);
    let height_px = math::round_to_i64(SIZE_PX[1] * rows as f64);
    let canvas = Canvas::untitled([WIDTH_PX, u32::try_from(height_px).unwrap_or(0)]);
    for (number, x_m) in places_m.iter().enumerate() {
        let left = (number % COLUMNS) as f64 * SIZE_PX[0];
        let top = (number / COLUMNS) as f64 * SIZE_PX[1];
        let row = row_at(&report.sections, *x_m);
        let range = row.and_then(|row| row.deviation).map_or_else(
            || "no samples".to_owned(),
            |deviation| format!("{:.2} to {:.2} m", deviation.inmost_m, deviation.outmost_m),
        );
        canvas.text([left + 8.0, top + 12.0], &station(*x_m), Side::Right, BOLD);
        canvas.text([left + SIZE_PX[0] - 12.0, top + 12.0], &range, Side::Left, SMALL);
        let frame = Frame {
            left: left + 8.0,
            top: top + 24.0,
            right: left + SIZE_PX[0] - 12.0,
            bottom: top + SIZE_PX[1] - 12.0,
        };
        cross_section(&canvas, frame, wall, wall.around(*x_m, report.target_m));
    }
    canvas.finish()
}

fn cross_section(canvas: &Canvas, frame: Frame, wall: &Wall, extent_m: [f64; 2]) {
    let arcs_m: Vec<f64> = (0..SECTORS).map(|sector| wall.arc_m(sector as f64 + 0.5)).collect();
    let design: Vec<[f64; 2]> = (0..=2 * SECTORS)
        .map(|half| wall.profile.point_at(wall.arc_m(half as f64 / 2.0) % wall.profile.perimeter_m()))
        .collect();
    let most =
        |axis: usize, sign: f64| design.iter().map(|point| sign * point[axis]).fold(f64::MIN, f64::max);
    let half_m = f64::max(most(0, 1.0) + most(0, -1.0), most(1, 1.0) + most(1, -1.0)) / 2.0 * 1.2;
    let middle = [0, 1].map(|axis| (most(axis, 1.0) - most(axis, -1.0)) / 2.0);
    let scale = f64::min(frame.right - frame.left, frame.bottom - frame.top) / 2.0 / half_m;
    let centre = [f64::midpoint(frame.left, frame.right), f64::midpoint(frame.top, frame.bottom)];
    // The section is seen looking along the tunnel, so the left wall (positive y) is on the left.
    let px = |[y, z]: [f64; 2]| [centre[0] - scale * (y - middle[0]), centre[1] - scale * (z - middle[1])];
    let mut grid_m = (middle[0] - half_m).ceil();
    while grid_m <= middle[0] + half_m {
        canvas.line(&[px([grid_m, middle[1] - half_m]), px([grid_m, middle[1] + half_m])], &GRID);
        grid_m += 1.0;
    }
    let mut grid_m = (middle[1] - half_m).ceil();
    while grid_m <= middle[1] + half_m {
        canvas.line(&[px([middle[0] - half_m, grid_m]), px([middle[0] + half_m, grid_m])], &GRID);
        grid_m += 1.0;
    }
    canvas.line(&design.iter().map(|point| px(*point)).collect::<Vec<_>>(), &TARGET);
    let reference = wall.profile.reference();
    let measured: Vec<Option<Px>> = arcs_m
        .iter()
        .enumerate()
        .map(|(sector, arc_m)| {
            let mean_m = wall.cell(extent_m, sector, 1).mean_m()?;
            let wanted = wall.profile.point_at(*arc_m);
            let [dy, dz] = [0, 1].map(|axis| wanted[axis] - reference[axis]);
            let share = 1.0 + mean_m / math::hypot(dy, dz).max(1e-9);
            Some(px([reference[0] + share * dy, reference[1] + share * dz]))
        })
        .collect();
    let closed: Vec<Option<Px>> = measured.iter().chain(measured.first()).copied().collect();
    for piece in closed.split(Option::is_none) {
        let places: Vec<Px> = piece.iter().flatten().copied().collect();
        for piece in frame.cut(&places) {
            canvas.line(&piece, &Look { width_px: 1.4, colour: BLACK, ..of_several(0) });
        }
    }
    let dots: Vec<Px> = measured.into_iter().flatten().filter(|place| frame.has(*place)).collect();
    if !dots.is_empty() {
        canvas.dots(&dots, 2.6, BLACK);
    }
}
