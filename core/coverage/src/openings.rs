//! Declared openings of the wall, such as side tunnels and gates.
//!
//! Openings do not count as holes. The report lists them.

use super::store::{SampleStore, StoreError, WallSample};
use headrace_geometry::math;
use headrace_geometry::tunnel::Profile;
use headrace_sampling::Target;

/// A declared opening of the wall.
#[derive(Debug, Clone, PartialEq)]
pub struct Opening {
    /// Display name of the opening.
    pub name: String,
    /// Chainage of the opening's beginning, m.
    pub from_m: f64,
    /// Chainage of the opening's end, m.
    pub to_m: f64,
    /// Arc length at which the opening begins, and its length along the perimeter, m.
    ///
    /// `None` for the whole perimeter.
    pub arc_m: Option<(f64, f64)>,
}

/// Maximum spacing of the samples that fill an opening, m.
///
/// For targets below half a metre, the spacing is a tenth of the target.
const SPACING_M: f64 = 0.05;

impl Opening {
    /// Returns the opening's extent along the perimeter, m: the arc length at which it begins, and its length.
    fn arc(&self, perimeter_m: f64) -> (f64, f64) {
        self.arc_m.map_or((0.0, perimeter_m), |(from_m, length_m)| (from_m, length_m.min(perimeter_m)))
    }

    /// Returns the numbers of intervals between filling samples, along the tunnel and along the perimeter. They are at
    /// most `spacing_m` long.
    fn counts(&self, perimeter_m: f64, spacing_m: f64) -> (i64, i64) {
        let over = |length_m: f64| (-math::floor_to_i64(-length_m / spacing_m)).max(1);
        (over(self.to_m - self.from_m), over(self.arc(perimeter_m).1))
    }

    /// Returns the number of samples that fill the opening.
    pub fn places(&self, perimeter_m: f64, target: Target) -> i64 {
        let (along, around) = self.counts(perimeter_m, spacing_m(target));
        (along + 1) * (around + 1)
    }

    /// Fills the opening with samples, so that a hole reaches into it by at most half the samples' spacing.
    ///
    /// Errors: the store is full, or the opening lies outside the store's extent.
    pub fn fill(&self, store: &mut SampleStore, target: Target) -> Result<(), StoreError> {
        let perimeter_m = store.perimeter_m();
        let (along, around) = self.counts(perimeter_m, spacing_m(target));
        let (first_m, length_m) = self.arc(perimeter_m);
        for i in 0..=along {
            let x_m = self.from_m + (self.to_m - self.from_m) * i as f64 / along as f64;
            for k in 0..=around {
                let arc_m = math::wrap(first_m + length_m * k as f64 / around as f64, perimeter_m);
                store.insert(WallSample { x_m, arc_m, head: 0, step_m: None, visit: u32::MAX })?;
            }
        }
        Ok(())
    }

    /// Share of a section's wall that the opening covers, 0 to 1.
    pub fn share_of(&self, from_m: f64, to_m: f64, profile: &Profile) -> f64 {
        let along_m = (to_m.min(self.to_m) - from_m.max(self.from_m)).max(0.0);
        let perimeter_m = profile.perimeter_m();
        let share = along_m / (to_m - from_m) * self.arc(perimeter_m).1 / perimeter_m;
        debug_assert!((0.0..=1.0 + 1e-9).contains(&share), "an opening covers a share of a section: {share}");
        share
    }
}

fn spacing_m(target: Target) -> f64 {
    SPACING_M.min(target.max_hole_m / 10.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hole::HoleFinder;
    use crate::store::StoreLayout;
    use headrace_geometry::tunnel::shapes;

    fn gate() -> Opening {
        Opening { name: "gate".to_owned(), from_m: 4.0, to_m: 6.0, arc_m: Some((17.0, 4.0)) }
    }

    /// A test wall with samples every half metre, except in the opening.
    fn store(profile: &Profile, with_opening: bool) -> SampleStore {
        let layout = StoreLayout {
            perimeter_m: profile.perimeter_m(),
            from_m: -5.0,
            to_m: 15.0,
            cell_m: 0.25,
            capacity: 100_000,
        };
        let mut store = SampleStore::new(layout);
        for i in 0..=20 {
            for k in 0..37 {
                let (x_m, arc_m) = (0.5 * f64::from(i), profile.perimeter_m() * f64::from(k) / 37.0);
                let around_m = math::wrap(arc_m - 17.0, profile.perimeter_m());
                if (4.0..=6.0).contains(&x_m) && around_m <= 4.0 {
                    continue;
                }
                store.insert(WallSample { x_m, arc_m, head: 0, step_m: None, visit: u32::MAX }).unwrap();
            }
        }
        if with_opening {
            gate().fill(&mut store, Target::new(0.8)).unwrap();
        }
        store
    }

    #[test]
    fn only_an_undeclared_opening_counts_as_a_hole() {
        let profile = shapes::circle(3.0).unwrap();
        let hole = |with: bool, from_m: f64| {
            let store = store(&profile, with);
            let found = HoleFinder::default().largest(&store, from_m, from_m + 0.25);
            found.diameter_m
        };
        assert!(hole(false, 5.0) > 2.0);
        for from_m in [3.5, 3.75, 4.0, 5.0, 6.0, 6.25] {
            let diameter_m = hole(true, from_m);
            assert!((0.68..0.8).contains(&diameter_m), "at {from_m} m: {diameter_m} m");
        }
    }

    #[test]
    fn opening_covers_a_share_of_the_wall_area_of_a_section() {
        let profile = shapes::circle(3.0).unwrap();
        let share = |from_m: f64| gate().share_of(from_m, from_m + 0.25, &profile);
        assert!((share(5.0) - 4.0 / profile.perimeter_m()).abs() < 1e-12);
        assert!((share(3.875) - 2.0 / profile.perimeter_m()).abs() < 1e-12);
        assert!(share(6.5) <= 0.0);
        let all_round = Opening { arc_m: None, ..gate() };
        assert!((all_round.share_of(5.0, 5.25, &profile) - 1.0).abs() < 1e-12);
    }

    /// An opening of 2 m by 4 m is filled with samples every 5 cm, or every 2 cm for a target of 0.2 m.
    #[test]
    fn number_of_samples_filled_into_an_opening_equals_the_predicted_number() {
        let profile = shapes::circle(3.0).unwrap();
        for (target_m, expected) in [(0.8, 41 * 81), (0.2, 101 * 201)] {
            let layout = StoreLayout {
                perimeter_m: profile.perimeter_m(),
                from_m: 0.0,
                to_m: 10.0,
                cell_m: 0.25,
                capacity: 100_000,
            };
            let mut store = SampleStore::new(layout);
            gate().fill(&mut store, Target::new(target_m)).unwrap();
            let counted = gate().places(profile.perimeter_m(), Target::new(target_m));
            let filled = i64::try_from(store.usage().kept + store.usage().thinned).unwrap();
            assert_eq!((counted, filled), (expected, expected), "{target_m}");
        }
    }
}
