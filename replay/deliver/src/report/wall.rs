//! The measured wall: mean deviation from the design by section and clock sector.

use std::collections::BTreeMap;

use headrace_coverage::deviation::off_m;
use headrace_geometry::math;
use headrace_geometry::tunnel::{Profile, Yz};
use headrace_monitor::result_stream::{RecordKind, first_record};
use headrace_monitor::run::Loop;

/// Number of clock sectors around the wall. Each is an eighth of an hour wide; the first begins at 6:00, the floor's
/// centre, and the numbers grow clockwise.
pub(super) const SECTORS: usize = 96;
const PER_HOUR: f64 = 8.0;

/// Wall samples in one or several sectors.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Cell {
    /// Number of samples.
    pub(super) samples: u32,
    /// Sum of the samples' deviations from the design, m; positive if the wall is outside the design.
    sum_m: f32,
}

impl Cell {
    /// Mean deviation from the design, m; `None` without samples.
    pub(super) fn mean_m(self) -> Option<f64> {
        (self.samples > 0).then(|| f64::from(self.sum_m) / f64::from(self.samples))
    }
}

/// The wall as measured in a dive. It takes about 800 bytes per section.
pub struct Wall {
    pub(super) profile: Profile,
    pub(super) section_m: f64,
    sections: BTreeMap<i64, Box<[Cell; SECTORS]>>,
    ticks: u64,
}

impl Wall {
    /// Creates the wall before the first tick of a dive.
    pub fn new(dive: &Loop) -> Self {
        let mission = dive.mission();
        let (profile, section_m) = (mission.profile.clone(), mission.section_m);
        Self { profile, section_m, sections: BTreeMap::new(), ticks: 0 }
    }

    /// Adds the samples of the latest tick. Call this method after every tick; further calls change nothing. The loop
    /// must keep its results.
    pub fn take(&mut self, dive: &Loop) {
        let tick = dive.ticks();
        if core::mem::replace(&mut self.ticks, tick) == tick {
            return;
        }
        let mut words = dive.view().surveyor().digests().pings.words();
        while let Some((record, rest)) = first_record(words) {
            words = rest;
            let [_, _, _, x, y, z, arc, ..] = *record.words else { continue };
            if record.kind == Some(RecordKind::Sample) {
                let [x_m, y_m, z_m, arc_m] = [x, y, z, arc].map(f64::from_bits);
                self.add(x_m, [y_m, z_m], arc_m);
            }
        }
    }

    #[expect(
        clippy::cast_possible_truncation,
        reason = "a sum of deviations needs no more than single precision"
    )]
    fn add(&mut self, x_m: f64, point: Yz, arc_m: f64) {
        let sector = self.sector(arc_m);
        let section = math::floor_to_i64(x_m / self.section_m);
        let cells = self.sections.entry(section).or_insert_with(|| Box::new([Cell::default(); SECTORS]));
        if let Some(cell) = cells.get_mut(sector) {
            cell.samples += 1;
            cell.sum_m += off_m(&self.profile, point, arc_m) as f32;
        }
    }

    /// Sector at an arc length.
    pub(super) fn sector(&self, arc_m: f64) -> usize {
        let hours = math::wrap(self.profile.hour(arc_m) - 6.0, 12.0);
        usize::try_from(math::floor_to_i64(hours * PER_HOUR)).unwrap_or(0).min(SECTORS - 1)
    }

    /// Samples of the sections whose middle is in a range of chainage, in `count` sectors from number `first`.
    pub(super) fn cell(&self, [from_m, to_m]: [f64; 2], first: usize, count: usize) -> Cell {
        let (begin, end) = (self.section(from_m), self.section(to_m));
        let mut sum = Cell::default();
        for cells in self.sections.range(begin..end.max(begin)).map(|(_, cells)| cells) {
            for cell in cells.iter().cycle().skip(first).take(count) {
                sum.samples += cell.samples;
                sum.sum_m += cell.sum_m;
            }
        }
        sum
    }

    /// Chainages of the least number of whole sections that together have at least a length. The section at `x_m` is
    /// the middle one, or the one after the middle.
    pub(super) fn around(&self, x_m: f64, length_m: f64) -> [f64; 2] {
        // A quotient such as 0.6 / 0.2 may be slightly more than a whole number.
        let count = math::floor_to_i64((length_m / self.section_m - 1e-9).ceil()).max(1);
        let first = math::floor_to_i64(x_m / self.section_m) - count / 2;
        [first, first + count].map(|section| section as f64 * self.section_m)
    }

    /// Length of the sections whose middle is in a range of chainage, m.
    pub(super) fn length_m(&self, [from_m, to_m]: [f64; 2]) -> f64 {
        (self.section(to_m) - self.section(from_m)) as f64 * self.section_m
    }

    /// Number of the first section whose middle is at a chainage or beyond it.
    fn section(&self, x_m: f64) -> i64 {
        -math::floor_to_i64(0.5 - x_m / self.section_m)
    }

    /// Arc length at which a sector begins, m. Sector [`SECTORS`] begins at the end of the perimeter.
    pub(super) fn arc_m(&self, sector: f64) -> f64 {
        if sector <= 0.0 {
            return 0.0;
        }
        if sector >= SECTORS as f64 {
            return self.profile.perimeter_m();
        }
        let [y_m, z_m] = self.profile.reference();
        let (sine, cosine) = math::sin_cos(math::TAU * sector / SECTORS as f64);
        self.profile.arc_of([y_m + sine, z_m - cosine])
    }

    /// Whether there are no samples.
    pub(super) fn is_empty(&self) -> bool {
        self.sections.is_empty()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use headrace_geometry::tunnel::shapes;

    #[test]
    fn outline_has_whole_sections_around_that_of_its_station() {
        let profile = shapes::circle(3.0).unwrap();
        let mut wall = Wall { profile, section_m: 0.25, sections: BTreeMap::new(), ticks: 0 };
        for (section_m, x_m, length_m, [from_m, to_m]) in [
            (0.25, 5.0, 0.25, [5.0, 5.25]),
            (0.25, 5.0, 0.1, [5.0, 5.25]),
            (0.25, 5.0, 0.5, [4.75, 5.25]),
            (0.25, 5.1, 0.75, [4.75, 5.5]),
            (0.2, -0.1, 0.6, [-0.4, 0.2]),
            (2.0, 5.0, 0.5, [4.0, 6.0]),
        ] {
            wall.section_m = section_m;
            let around_m = wall.around(x_m, length_m);
            let off_m = (around_m[0] - from_m).abs().max((around_m[1] - to_m).abs());
            assert!(off_m < 1e-9, "{section_m}, {x_m}, {length_m}: {around_m:?}");
        }
    }

    #[test]
    fn samples_are_found_in_their_section_and_sector() {
        let profile = shapes::circle(3.0).unwrap();
        let mut wall = Wall { profile, section_m: 0.25, sections: BTreeMap::new(), ticks: 0 };
        let left_m = wall.arc_m(24.0);
        assert_eq!(wall.profile.clock(left_m), "9:00");
        let [y, z] = wall.profile.point_at(left_m + 0.05);
        wall.add(10.1, [y + 0.2, z], left_m + 0.05);
        let cell = wall.cell([10.0, 10.25], 24, 1);
        assert!((cell.mean_m().unwrap() - 0.2).abs() < 0.01, "{cell:?}");
        assert_eq!(wall.cell([10.25, 11.0], 24, 1).samples + wall.cell([10.0, 10.25], 20, 4).samples, 0);
        assert_eq!(wall.cell([10.0, 10.25], 95, 30).samples, 1);
        assert_eq!(wall.cell([0.0, 11.0], 0, SECTORS).mean_m(), cell.mean_m());
    }
}
