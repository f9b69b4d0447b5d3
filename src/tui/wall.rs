//! The tunnel wall by section: the data in a frame, and the strips drawn from these data.

use headrace_coverage::Verdict;
use headrace_geometry::math;
use headrace_geometry::tunnel::{Profile, WallPoint};
use headrace_monitor::run::Loop;

/// Number of parts into which the perimeter is divided for clock positions.
const PARTS: usize = 96;
/// Number of clock hours, which name positions on the perimeter.
pub(super) const HOURS: usize = 12;

/// Converts an arc length to a clock hour.
pub(super) struct Clock {
    part_m: f64,
    /// Bit mask of the clock hour of each part of the perimeter.
    bits: [u16; PARTS],
}

impl Clock {
    pub(super) fn of(profile: &Profile) -> Self {
        let part_m = profile.perimeter_m() / PARTS as f64;
        let hour = |part: usize| {
            let text = profile.clock((part as f64 + 0.5) * part_m);
            text.split(':').next().and_then(|hour| hour.parse::<u16>().ok()).unwrap_or(0) % 12
        };
        Self { part_m, bits: core::array::from_fn(|part| 1 << hour(part)) }
    }

    fn bit(&self, arc_m: f64) -> u16 {
        let part = usize::try_from(math::floor_to_i64(arc_m / self.part_m)).unwrap_or(0);
        self.bits.get(part.min(PARTS - 1)).copied().unwrap_or(0)
    }
}

/// State of a section, as the screen shows it.
///
/// If a column shows several sections, the variant that comes last in this list wins.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default)]
pub(super) enum Known {
    /// The section has no sample.
    #[default]
    Unseen,
    Pass,
    /// Driving on may still fill the section's hole.
    Open,
    NotInspected,
    CannotSay,
    /// The section fails, or is flagged.
    Missed,
}

/// A section's data for the screen.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Cell {
    pub(super) known: Known,
    /// Diameter of the section's largest hole, divided by the target.
    pub(super) share: Option<f64>,
    /// Clock hours that have samples within half the target. Bit 0 is 12 o'clock.
    pub(super) seen: u16,
}

impl Cell {
    /// Data of the section with this index; `None` if there is no such section.
    pub(super) fn of(index: i64, dive: &Loop, clock: &Clock) -> Option<Self> {
        let coverage = dive.view().coverage();
        let sections = &coverage.sections;
        let section = sections.get(index)?;
        let known = match section.verdict {
            _ if section.is_flagged() => Known::Missed,
            Verdict::Fail => Known::Missed,
            Verdict::CannotSay => Known::CannotSay,
            Verdict::Pass => Known::Pass,
            Verdict::Open if section.not_inspected => Known::NotInspected,
            Verdict::Open if section.samples > 0 => Known::Open,
            Verdict::Open => Known::Unseen,
        };
        let mut seen = 0;
        if section.samples > 0 {
            // Wall within half the target of a sample counts as covered, because a hole that passes is at most as wide
            // as the target.
            let (from_m, to_m) = sections.bounds_m(index);
            let half_m = sections.target().max_hole_m / 2.0;
            let (from_m, to_m) = (from_m - half_m, to_m + half_m);
            coverage.store.each_between(from_m, to_m, |WallPoint { x_m, arc_m }, _| {
                if (from_m..to_m).contains(&x_m) {
                    seen |= clock.bit(arc_m);
                }
            });
        }
        // A clock hour counts as not covered if a hole that is too large lies there.
        if let Some(hole) = section.hole.filter(|_| matches!(known, Known::Missed | Known::CannotSay)) {
            seen &= !clock.bit(hole.arc_m);
        }
        let share = section.hole.map(|hole| hole.diameter_m / sections.target().max_hole_m);
        Some(Self { known, share: share.filter(|_| section.verdict != Verdict::Open), seen })
    }

    fn worse(self, other: Self) -> Self {
        Self {
            known: self.known.max(other.known),
            share: self.share.into_iter().chain(other.share).reduce(f64::max),
            seen: self.seen & other.seen,
        }
    }
}

/// Data about the wall in a frame of the screen.
pub(super) struct WallNews {
    pub(super) section_m: f64,
    pub(super) count: usize,
    /// Chainage of the vehicle, m; `None` without a position.
    pub(super) at_m: Option<f64>,
    /// Whether the vehicle moves into the tunnel, so that chainage increases.
    pub(super) inwards: bool,
    pub(super) cells: Vec<(i64, Cell)>,
}

/// Part of the wall that the screen shows.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) enum Extent {
    /// One section per column, near the vehicle.
    #[default]
    Near,
    /// The whole stretch that has samples.
    Way,
    Tunnel,
}

impl Extent {
    pub(super) fn next(self) -> Self {
        match self {
            Self::Near => Self::Way,
            Self::Way => Self::Tunnel,
            Self::Tunnel => Self::Near,
        }
    }

    pub(super) fn words(self) -> &'static str {
        match self {
            Self::Near => "near the vehicle",
            Self::Way => "seen so far",
            Self::Tunnel => "whole tunnel",
        }
    }
}

/// The wall on the screen, with all sections received so far.
#[derive(Default)]
pub(super) struct Wall {
    section_m: f64,
    at_m: Option<f64>,
    /// Last known chainage of the vehicle, m. The wall is shown around it.
    middle_m: f64,
    inwards: bool,
    cells: Vec<Cell>,
}

/// A strip of the wall along the tunnel, in columns of the screen.
pub(super) struct Strip {
    /// The columns, each with the worst of its sections; `None` beyond the tunnel's end.
    pub(super) columns: Vec<Option<Cell>>,
    /// Chainage at which the first column begins, m. `column_m` is the length of a column.
    pub(super) from_m: f64,
    pub(super) column_m: f64,
    /// Column at which the vehicle is, and whether it moves to the right.
    pub(super) vehicle: Option<(usize, bool)>,
}

impl Wall {
    pub(super) fn take(&mut self, news: &WallNews) {
        (self.section_m, self.at_m, self.inwards) = (news.section_m, news.at_m, news.inwards);
        self.middle_m = news.at_m.unwrap_or(self.middle_m);
        self.cells.resize(news.count, Cell::default());
        for (index, cell) in &news.cells {
            if let Some(here) = usize::try_from(*index).ok().and_then(|index| self.cells.get_mut(index)) {
                *here = *cell;
            }
        }
    }

    /// Strip of this extent with `columns` columns.
    pub(super) fn strip(&self, extent: Extent, columns: usize) -> Strip {
        let columns = columns.max(1);
        let section_of = |x_m: f64| math::floor_to_i64(x_m / self.section_m.max(1e-9));
        let (from, each) = match extent {
            Extent::Near => (self.near(section_of(self.middle_m), columns), 1),
            Extent::Way => {
                let seen = |cell: &Cell| cell.known != Known::Unseen;
                let first = self.cells.iter().position(seen).unwrap_or(0);
                let last = self.cells.iter().rposition(seen).map_or(1, |last| last + 1);
                // A column shows at least one section.
                let each = (last.saturating_sub(first)).div_ceil(columns).max(1);
                (first as i64, each)
            }
            Extent::Tunnel => (0, self.cells.len().div_ceil(columns).max(1)),
        };
        let of = |column: usize| {
            let first = from + (column * each) as i64;
            let all =
                (first..first + each as i64).filter_map(|index| self.cells.get(usize::try_from(index).ok()?));
            all.copied().reduce(Cell::worse)
        };
        let column_of = |here: i64| usize::try_from((here - from).div_euclid(each as i64)).ok();
        let vehicle = self.at_m.map(section_of).and_then(column_of).filter(|column| *column < columns);
        Strip {
            columns: (0..columns).map(of).collect(),
            from_m: from as f64 * self.section_m,
            column_m: each as f64 * self.section_m,
            vehicle: vehicle.map(|column| (column, self.inwards)),
        }
    }

    /// Index of the first section of a strip around the vehicle.
    ///
    /// The strip moves in steps of a quarter of its width, so the picture is stationary between steps.
    fn near(&self, here: i64, columns: usize) -> i64 {
        let step = (columns as i64 / 4).max(1);
        let from = here.div_euclid(step) * step - 2 * step + if self.inwards { 0 } else { step };
        from.clamp(0, (self.cells.len() as i64 - columns as i64).max(0))
    }
}

#[cfg(test)]
mod tests {
    use headrace_geometry::tunnel::shapes;

    use super::*;

    fn wall(count: usize, at_m: f64) -> Wall {
        let mut wall = Wall::default();
        let known = |index: usize| if index < 10 { Known::Pass } else { Known::Unseen };
        let cell = |index: usize| Cell { known: known(index), share: Some(0.5), seen: 1 << (index % 2) };
        let cells = (0..count).map(|index| (index as i64, cell(index))).collect();
        wall.take(&WallNews { section_m: 0.5, count, at_m: Some(at_m), inwards: true, cells });
        wall
    }

    #[test]
    fn clock_has_12_hours_with_6_at_the_floor() {
        let profile = shapes::circle(3.0).unwrap();
        let clock = Clock::of(&profile);
        assert_eq!(clock.bits.iter().fold(0, |all, bit| all | bit), 0xfff);
        assert_eq!(clock.bit(0.0), 1 << 6);
        assert_eq!(clock.bit(profile.perimeter_m() / 2.0), 1);
    }

    #[test]
    fn wall_column_shows_its_worst_section_and_the_clock_hours_that_all_its_sections_cover() {
        let strip = wall(100, 2.0).strip(Extent::Tunnel, 50);
        assert_eq!((strip.columns.len(), strip.column_m), (50, 1.0));
        let first = strip.columns[0].unwrap();
        assert_eq!((first.known, first.seen), (Known::Pass, 0));
        assert_eq!(strip.vehicle, Some((2, true)));
        let missed = Cell { known: Known::Missed, share: None, seen: 3 };
        assert_eq!(missed.worse(first), Cell { known: Known::Missed, share: Some(0.5), seen: 0 });
    }

    #[test]
    fn wall_strip_contains_the_vehicle_and_has_no_columns_beyond_the_tunnel() {
        for (at_m, count) in [(0.0, 400), (47.3, 400), (199.9, 400), (3.0, 20)] {
            let strip = wall(count, at_m).strip(Extent::Near, 60);
            let (column, _) = strip.vehicle.unwrap();
            let from_m = strip.from_m + column as f64 * strip.column_m;
            assert!((from_m..from_m + 0.5).contains(&at_m), "{at_m}: column {column} from {}", strip.from_m);
        }
        assert!(wall(20, 3.0).strip(Extent::Near, 60).columns[20].is_none());
        assert_eq!(
            wall(400, 2.0)
                .strip(Extent::Way, 60)
                .columns
                .iter()
                .flatten()
                .filter(|cell| cell.known == Known::Pass)
                .count(),
            10
        );
    }
}
