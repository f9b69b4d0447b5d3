//! Tunnel, speed and head positions inferred from the printed baselines.

use headrace_geometry::math;
use headrace_geometry::tunnel::shapes;

use super::baseline::Baselines;
use super::cell::{Cell, Note, NoteKind};
use super::drift::{Rig, floor_m, height_m};
use super::printed::{Digits, Interval, Line, lines};
use super::{FITTING_SPEED_MPS, PaperError, STATED_SPEED_MPS};

/// Position of a head relative to the corner between floor and wall.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Place {
    /// Height above the floor, m.
    pub(super) floor_m: f64,
    /// Horizontal distance from the corner, m.
    pub(super) aside_m: f64,
}

/// The position from which Eq. 5 and 6 give a rig's printed ping distances T_ymin and T_ymax.
///
/// The positions were found by search. The tests check every printed digit that isn't an erratum.
pub(super) fn fitting_place(rig: Rig) -> Place {
    match rig {
        Rig::Vita1 => Place { floor_m: 2.511, aside_m: 6.613 },
        Rig::Vita2InLine => Place { floor_m: 2.600, aside_m: 6.664 },
        Rig::Vita2Pairs => Place { floor_m: 2.607, aside_m: 6.749 },
    }
}

/// Whether the columns of the ping distance T_y in this row of Table 4 are copied from the row of mode FASTER.
pub(super) fn is_copied(mode: &str, heads: u8) -> bool {
    mode == "FAST" && heads >= 3
}

/// Interval of an input, such as the perimeter or the speed, that agrees with the printed numbers of all `wanted` rows.
fn of_rows(
    rows: impl IntoIterator<Item = Line>,
    wanted: impl Fn(&str, u8) -> bool,
    source: impl Fn(&Line) -> Result<Interval, PaperError>,
) -> Result<Interval, PaperError> {
    let mut intervals = Vec::new();
    for line in rows {
        if wanted(line.text("mode")?, line.heads()?) {
            intervals.push(source(&line)?);
        }
    }
    Ok(Interval::common(intervals))
}

/// Perimeters that give all printed means of Tables 3 and 4, m. A mean is the perimeter divided by the number n of
/// samples per turn.
///
/// The first interval assumes rounding; the second one also allows truncation.
pub(super) fn perimeters_m(baselines: &Baselines) -> Result<[Interval; 2], PaperError> {
    let perimeter = |from: fn(&super::Printed) -> Interval| {
        of_rows(
            lines(3).into_iter().chain(lines(4)),
            |mode, heads| !is_copied(mode, heads),
            |line| {
                let steps = f64::from(baselines.of(line)?.0.turn.steps());
                Ok(from(&line.printed("base_ty_mean")?).scaled(steps))
            },
        )
    };
    Ok([perimeter(super::Printed::rounded_from)?, perimeter(super::Printed::read_from)?])
}

/// Two intervals of speeds, m/s. The first speeds give all distances T_x printed in Table 3, except those of FAST. The
/// second ones give all T_x / s and 2 T_x / s of Table 4.
pub(super) fn speeds_mps(baselines: &Baselines) -> Result<[Interval; 2], PaperError> {
    let speed = |line: &Line, column, passes: f64| {
        let period_s = baselines.of(line)?.0.turn.period_s();
        Ok::<_, PaperError>(line.printed(column)?.read_from().scaled(passes / period_s))
    };
    let one_head = of_rows(lines(3), |mode, _| mode != "FAST", |line| speed(line, "base_tx", 1.0))?;
    let several = of_rows(
        lines(4),
        |_, _| true,
        |line| {
            let heads = f64::from(line.heads()?);
            let phase = speed(line, "base_phase_tx", heads)?;
            Ok(Interval::common([phase, speed(line, "base_sector_tx", heads / 2.0)?]))
        },
    )?;
    Ok([one_head, several])
}

/// Distances from the floor with which Eq. 5 gives a rig's printed minima in the selected modes, m.
pub(super) fn floors_m(
    baselines: &Baselines,
    rig: Rig,
    wanted: impl Fn(&str) -> bool,
) -> Result<Interval, PaperError> {
    of_rows(
        lines(3).into_iter().chain(lines(4)),
        |mode, heads| Rig::of(heads) == rig && !is_copied(mode, heads) && wanted(mode),
        |line| {
            let tangent = math::tan(baselines.of(line)?.0.turn.step_rad());
            Ok(line.printed("base_ty_min")?.rounded_from().scaled(1.0 / tangent))
        },
    )
}

/// The step along a flat floor that ends in the corner, m (Eq. 6, with the angle m theta at the corner).
pub(super) fn corner_step_m(place: Place, step_rad: f64) -> f64 {
    let corner = math::atan2(place.aside_m, place.floor_m);
    place.floor_m * (math::tan(corner) - math::tan(corner - step_rad))
}

/// Note on why the recomputed means differ from those printed in Table 3.
pub(super) fn means<'a>(
    mark: char,
    baselines: &Baselines,
    rows: impl Iterator<Item = (&'static str, &'a Cell)>,
) -> Result<Note, PaperError> {
    let [rounded, read] = perimeters_m(baselines)?;
    let (ours_m, stated_m) = (shapes::ceran_blueprint()?.perimeter_m(), shapes::ceran()?.perimeter_m());
    let misses: Vec<String> = rows
        .filter(|(_, cell)| cell.digits == Digits::Neither)
        .map(|(mode, cell)| {
            format!("{mode} by {:.3} mm", 1e3 * cell.printed.rounded_from().missed_by(cell.ours))
        })
        .collect();
    let text = format!(
        "p / n: the printed means of Tables 3 and 4, copied rows apart, are all those of a perimeter from {:.3} to \
         {:.3} m, rounded (to {:.3} m if some are truncated). The blueprint's {ours_m:.2} m is {:.3} m short ({:.2} \
         %), and its p / n falls short of what rounds to the printed digits: {}. The stated dimensions ({stated_m:.2} m) are {:.2} m over.",
        rounded.low,
        rounded.high,
        read.high,
        rounded.missed_by(ours_m),
        100.0 * rounded.missed_by(ours_m) / rounded.low,
        misses.join(", "),
        rounded.missed_by(stated_m),
    );
    Ok(Note::new(mark, NoteKind::Finding, text))
}

/// Note on the speed of Table 4.
pub(super) fn speed(mark: char, baselines: &Baselines) -> Result<Note, PaperError> {
    let [one_head, several] = speeds_mps(baselines)?;
    let text = format!(
        "T_x / s and 2 T_x / s are those of {FITTING_SPEED_MPS} m/s throughout, where the paper says \
         {STATED_SPEED_MPS}: all 30 follow from {:.6} to {:.6} m/s (SLOW's 2.116 truncated from 2.1168), none from \
         {STATED_SPEED_MPS}. Table 3's, FAST apart, follow from {:.6} to {:.6} m/s.",
        several.low, several.high, one_head.low, one_head.high,
    );
    Ok(Note::new(mark, NoteKind::NewErratum, text))
}

/// Note on why the recomputed minima differ from those printed in Table 3.
pub(super) fn minima_of_one(mark: char, baselines: &Baselines) -> Result<Note, PaperError> {
    let profile = shapes::ceran_blueprint()?;
    let most = floors_m(baselines, Rig::Vita1, |mode| mode != "FASTEST")?;
    let rest = floors_m(baselines, Rig::Vita1, |mode| mode == "FASTEST")?;
    let text = format!(
        "Eq. 5: no one distance to the floor gives all five. {:.3} to {:.3} m give all but FASTEST's 0.100, which \
         takes {:.3} to {:.3} m (2.51 m: 0.105). Ours: {:.3} m, half of the height of {:.3} m less 1.5 m of drift \
         and 0.15 m of mounting.",
        most.low,
        most.high,
        rest.low,
        rest.high,
        floor_m(&profile, Rig::Vita1)?,
        height_m(&profile)?,
    );
    Ok(Note::new(mark, NoteKind::Erratum, text))
}

/// Note on why the recomputed minima differ from those printed in Table 4.
pub(super) fn minima_of_several(mark: char, baselines: &Baselines) -> Result<Note, PaperError> {
    let in_line = floors_m(baselines, Rig::Vita2InLine, |mode| mode != "FASTEST")?;
    let fastest = floors_m(baselines, Rig::Vita2InLine, |mode| mode == "FASTEST")?;
    let pairs = floors_m(baselines, Rig::Vita2Pairs, |_| true)?;
    let text = format!(
        "Eq. 5: two heads: {:.3} to {:.3} m above the floor give all but FASTEST's 0.100, which takes {:.3} to {:.3} \
         m. Three and four heads: {:.3} to {:.3} m give all but the copied rows. Ours: {:.3} m.",
        in_line.low,
        in_line.high,
        fastest.low,
        fastest.high,
        pairs.low,
        pairs.high,
        floor_m(&shapes::ceran_blueprint()?, Rig::Vita2Pairs)?,
    );
    Ok(Note::new(mark, NoteKind::Erratum, text))
}

/// Note on why the recomputed maxima differ from those printed in Table 3.
pub(super) fn maxima_of_one(mark: char, baselines: &Baselines) -> Result<Note, PaperError> {
    let place = fitting_place(Rig::Vita1);
    let slow_m = corner_step_m(place, baselines.mode("SLOW")?.turn.step_rad());
    let text = format!(
        "the printed maxima, SLOW's apart, agree with Eq. 6 where its last step ends in the corner, and the corner is \
         (fitted) {:.3} m below the head and {:.3} m aside; SLOW would be {slow_m:.3}. Ours: rays cast in the \
         blueprint's tunnel, the worst of drifts of 0 and 1.5 m either way across and up and down, and of headings of \
         0 and 15 deg either way.",
        place.floor_m, place.aside_m,
    );
    Ok(Note::new(mark, NoteKind::Finding, text))
}

/// Note on why the recomputed maxima differ from those printed in Table 4.
pub(super) fn maxima_of_several(mark: char, baselines: &Baselines) -> Result<Note, PaperError> {
    let (in_line, pairs) = (fitting_place(Rig::Vita2InLine), fitting_place(Rig::Vita2Pairs));
    let fast_m = corner_step_m(pairs, baselines.mode("FAST")?.turn.step_rad());
    let text = format!(
        "as in Table 3, with the corner (fitted) {:.3} m below and {:.3} m aside for two heads, {:.3} m and {:.3} m \
         for three and four, where FAST would be {fast_m:.3}.",
        in_line.floor_m, in_line.aside_m, pairs.floor_m, pairs.aside_m,
    );
    Ok(Note::new(mark, NoteKind::Finding, text))
}
