//! Decides which sections are due for judging.
//!
//! During the dive, a section is due if the heads have left it, or if a part of it may already be certain to fail. At
//! the end of the dive, a section is due if its verdict may still change.

use super::section_table::{Ended, Judging, LOOK_AT_ONCE, Request, Sections, clamp};
use crate::frontier::{Moved, Outlook, Reach, clear_of};
use crate::hole::{FARTHEST_M, Needed};
use crate::section::Verdict;
use headrace_geometry::math;

/// Distance travelled between two checks of the sections that the heads have left, m. It is the largest delay of a
/// flag.
const LOOK_M: f64 = 0.125;

impl Sections {
    /// Whether the heads have moved far enough for some sections to be due for judging.
    pub fn may_be_due(&self, moved: &Moved) -> bool {
        let [behind_m, ahead_m] = self.next_look_m;
        let is_due = |reach: Reach| reach.from_m >= behind_m || reach.to_m <= ahead_m;
        !moved.is_nothing() || moved.to_come.is_some_and(is_due)
    }

    /// Sets the chainages of the heads' reach at which sections are checked next.
    ///
    /// Each section is divided into parts of at most [`LOOK_M`]. A check is due whenever the heads have left another
    /// part: behind the vehicle, or ahead of it while it goes back.
    fn look_again(&mut self, to_come: Option<Reach>) {
        let Some(Reach { from_m, to_m }) = to_come else { return };
        let parts = (-math::floor_to_i64(-self.section_m / LOOK_M)).max(1);
        let (step_m, left_m) = (self.section_m / parts as f64, self.left_m());
        let after_m = |x_m: f64| ((math::floor_to_i64(x_m / step_m) + 1) as f64) * step_m;
        let [at_once_behind, at_once_ahead] = LOOK_AT_ONCE;
        self.next_look_m = [
            if from_m.is_finite() { after_m(from_m - left_m) + left_m } else { at_once_behind },
            if to_m.is_finite() { -after_m(-to_m - left_m) - left_m } else { at_once_ahead },
        ];
    }

    /// Calls `ask` for every section of the coverage extent that is due after the heads have moved.
    ///
    /// A section is due if it left the zone or was never in it, if its hole can get no more samples, or if a part of it
    /// may already be certain to fail.
    ///
    /// Allocates: never.
    pub fn due(&mut self, moved: &Moved, outlook: &Outlook, ask: &mut impl FnMut(Request)) {
        self.look_again(moved.to_come);
        let way = self.sections_of(outlook.way);
        let ask_for = Request::at(outlook);
        for range in [&moved.left_behind, &moved.left_ahead] {
            for index in clamp(range.clone(), &way) {
                let Some(section) = self.get_mut(index) else {
                    debug_assert!(false, "section {index} of {way:?} exists");
                    continue;
                };
                if section.stale || section.hole.is_none() || section.not_inspected {
                    section.stale = false;
                    section.settled = false;
                    ask(ask_for(index));
                }
            }
        }
        let far = math::floor_to_i64(FARTHEST_M / self.section_m) + 1;
        // The heads may have passed only a part of each section at the zone's ends.
        let behind = moved.left_behind.end - far..moved.left_behind.end + 1;
        let ahead = moved.left_ahead.start - 1..moved.left_ahead.start + far;
        for range in [behind, ahead] {
            for index in clamp(range, &way) {
                let target = self.target;
                let bounds_m = self.bounds_m(index);
                let Some(section) = self.get_mut(index).filter(|section| !section.settled) else { continue };
                let may_fail = !section.is_flagged() && section.verdict == Verdict::Open;
                let is_out = index < moved.left_behind.end || index >= moved.left_ahead.start;
                let Some(hole) = section.hole else {
                    // A section of the coverage extent that was never judged lies beside the heads, or where the
                    // vehicle set out.
                    let (from_m, to_m) = bounds_m;
                    let clear = clear_of(moved.to_come, from_m).min(clear_of(moved.to_come, to_m)) > 0.0;
                    if !is_out {
                        ask(Request { only_fails: true, ..ask_for(index) });
                    } else if clear && !moved.has_left(index) {
                        ask(ask_for(index));
                    }
                    continue;
                };
                let clear_m = clear_of(moved.to_come, hole.x_m);
                let left_m = hole.least_m.min(2.0 * clear_m);
                let fails = section.verdict == Verdict::Open
                    && left_m - target.error_m(section.hole_sd_m) > target.max_hole_m;
                if fails || clear_m >= hole.diameter_m / 2.0 {
                    ask(ask_for(index));
                } else if may_fail {
                    ask(Request { only_fails: true, ..ask_for(index) });
                }
            }
        }
    }

    /// Calls `ask` for sections in reach of a vehicle that is nearly stationary. Otherwise they would get no verdict
    /// while it is stationary.
    ///
    /// An unflagged section is always due, because it may have become certain to fail. A flagged section is due if it
    /// has new samples since it was judged.
    ///
    /// Allocates: never.
    pub fn look_around(&mut self, outlook: &Outlook, ask: &mut impl FnMut(Request)) {
        let Some(zone) = outlook.still_zone.clone() else { return };
        let ask_for = Request::at(outlook);
        for index in clamp(zone, &self.sections_of(outlook.way)) {
            let Some(section) = self.get_mut(index) else {
                debug_assert!(false, "section {index} of the coverage extent exists");
                continue;
            };
            let is_flagged = section.is_flagged();
            if !is_flagged || core::mem::take(&mut section.stale) {
                ask(Request { only_fails: !is_flagged, ..ask_for(index) });
            }
        }
    }

    /// Whether a section already has an empty circle that exceeds the target by more than the errors.
    ///
    /// The circle must lie where all heads have been and no more samples will land.
    pub(super) fn fails_already(&self, request: &Request, judging: &mut Judging<'_>) -> bool {
        let Judging { store, finder, profile, .. } = judging;
        let Request { section: index, to_come, not_passed, .. } = *request;
        let (Some(section), Some(_)) = (self.get(index), not_passed) else { return false };
        let bounds_m = self.bounds_m(index);
        let clear_m = |reach| clear_of(reach, bounds_m.0).max(clear_of(reach, bounds_m.1));
        let (half_m, half_k) = (self.target.max_hole_m / 2.0, self.target.confidence_sd / 2.0);
        let most_clear_m = clear_m(to_come).min(clear_m(not_passed));
        if most_clear_m <= half_m {
            return false;
        }
        let pass_error = self.pass_error(index);
        let radius_m = |pass_sd_m: f64| half_m + half_k * section.visits.sd_m(pass_sd_m);
        let needed = Needed {
            radius_m: &|arc_m| radius_m(pass_error.sd_m(profile.point_at(arc_m))),
            most_m: radius_m(pass_error.worst_m(profile)),
            slope: half_k * pass_error.slope(),
        };
        let least_m = needed.most_m - needed.slope * profile.perimeter_m() / 2.0;
        most_clear_m > least_m && finder.has_circle(store, bounds_m, [to_come, not_passed], &needed)
    }

    /// Calls `ask` for the sections of the coverage extent at the end of a dive. Settled passes without new samples are
    /// left out.
    pub fn unsettled(&mut self, outlook: &Outlook, ask: &mut impl FnMut(Request)) {
        let ask_for = Request::at(outlook);
        for index in self.sections_of(outlook.way) {
            let Some(section) = self.get_mut(index) else {
                debug_assert!(false, "section {index} of the coverage extent exists");
                continue;
            };
            // The hole of a failed section may have become smaller through samples too far away to change a pass.
            if section.stale || !section.settled || section.verdict != Verdict::Pass {
                section.stale = false;
                ask(Request { ended: Some(Ended(outlook.through)), ..ask_for(index) });
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hole::{Hole, HoleFinder};
    use crate::missing_samples::MissingSamples;
    use crate::passage::PassError;
    use crate::section::Section;
    use crate::store::{SampleStore, StoreLayout, WallSample};
    use headrace_fusion::relative::Relative;
    use headrace_geometry::time::MonoNs;
    use headrace_geometry::tunnel::shapes;
    use headrace_sampling::Target;

    /// The heads have passed some sections only in part. These are checked at least every 12.5 cm of travel, behind and
    /// ahead of the vehicle.
    #[test]
    fn next_check_is_due_within_12_5_cm_of_travel() {
        let mut sections = Sections::new(0.25, Target::new(0.5), -1.0, 10.0);
        for k in 0..100 {
            let x_m = 4.0 + 0.013 * f64::from(k);
            sections.look_again(Some(Reach { from_m: x_m, to_m: x_m }));
            let [behind_m, ahead_m] = sections.next_look_m;
            for on_m in [behind_m - x_m, x_m - ahead_m] {
                assert!(on_m > 0.0 && on_m <= LOOK_M + 1e-9, "{on_m} m on from {x_m} m");
            }
        }
        sections.look_again(Some(Reach { from_m: f64::NEG_INFINITY, to_m: f64::INFINITY }));
        assert_eq!(sections.next_look_m.map(f64::to_bits), LOOK_AT_ONCE.map(f64::to_bits));
    }

    /// Around a stationary vehicle, a failed section is judged again only after new samples.
    ///
    /// All other sections are judged at each check, because they may have become certain to fail.
    #[test]
    fn failed_section_at_a_stationary_vehicle_is_judged_again_only_after_new_samples() {
        let mut sections = Sections::new(0.25, Target::new(0.5), -1.0, 10.0);
        for (index, flagged, stale) in
            [(8, false, true), (9, false, false), (10, true, true), (11, true, false)]
        {
            let section = sections.get_mut(index).unwrap();
            (section.flagged, section.stale) = (flagged.then_some(MonoNs(1)), stale);
        }
        let mut asked = |still_zone: Option<core::ops::Range<i64>>, way: Option<Reach>| {
            let outlook = Outlook {
                at: MonoNs(7),
                way,
                swept_by_all: None,
                none_alive: false,
                to_come: None,
                not_passed: None,
                through: None,
                still_zone,
            };
            let mut all = Vec::new();
            sections.look_around(&outlook, &mut |request| all.push((request.section, request.only_fails)));
            all
        };
        let way = Some(Reach { from_m: 0.1, to_m: 2.9 });
        assert_eq!(asked(None, way), [], "the vehicle moves");
        assert_eq!(asked(Some(8..12), None), [], "the vehicle has no coverage extent");
        assert_eq!(asked(Some(8..12), way), [(8, true), (9, true), (10, false)]);
        assert_eq!(asked(Some(8..40), way), [(8, true), (9, true)], "no samples came since");
    }

    /// Returns the requests after the heads have left the stretch from 2.5 to 3 m. Samples may land from 3.25 m on.
    ///
    /// Each request is given by the section's index, and by whether it asks only for a certain fail.
    fn due(set: impl Fn(&mut Sections)) -> Vec<(i64, bool)> {
        let mut sections = Sections::new(0.25, Target::new(0.5), 1.0, 10.0);
        set(&mut sections);
        let to_come = Some(Reach { from_m: 3.25, to_m: f64::INFINITY });
        let moved = Moved { left_behind: 10..12, left_ahead: 16..16, way_grown: false, to_come };
        let outlook = Outlook {
            at: MonoNs(7),
            way: Some(Reach { from_m: 1.1, to_m: 3.9 }),
            swept_by_all: None,
            none_alive: false,
            to_come,
            not_passed: None,
            through: None,
            still_zone: None,
        };
        let mut all = Vec::new();
        sections.due(&moved, &outlook, &mut |request| all.push((request.section, request.only_fails)));
        all.sort_unstable();
        all
    }

    /// Returns the requests if every section except `index` is settled and judged.
    fn alone(index: i64, set: impl Fn(&mut Section)) -> Vec<(i64, bool)> {
        due(|sections| {
            for other in 4..16 {
                let section = sections.get_mut(other).unwrap();
                (section.hole, section.settled) = (Some(hole(0.3, 1.0)), true);
                if other == index {
                    set(section);
                }
            }
        })
    }

    fn hole(diameter_m: f64, x_m: f64) -> Hole {
        Hole { diameter_m, least_m: diameter_m, most_m: diameter_m, x_m, arc_m: 1.0, bounded: true }
    }

    #[test]
    fn section_without_a_verdict_is_judged_when_the_heads_have_left_it() {
        let found = due(|_| {});
        // All sections behind the zone get a full judgement. A section at an end of the zone may fail because of the
        // part that the heads have left. Sections ahead are not judged.
        let mut expected: Vec<_> = (4..12).map(|index| (index, false)).collect();
        expected.extend([(12, true), (15, true)]);
        assert_eq!(found, expected);
        assert_eq!(alone(10, |_| {}), [], "the section has been judged, and no samples came since");
        assert_eq!(alone(10, |section| section.stale = true)[0], (10, false));
        assert_eq!(alone(10, |section| section.not_inspected = true)[0], (10, false));
        assert_eq!(alone(10, |section| section.hole = None), [(10, false)]);
        assert_eq!(alone(9, |section| section.stale = true), [], "the heads left the section earlier");
    }

    /// A section may fail early because a part of its hole is already out of the heads' reach.
    ///
    /// This part is a circle about the hole's centre that just touches the reach. If all of the hole is out of reach,
    /// the section gets its final verdict.
    #[test]
    fn hole_is_judged_when_a_large_enough_part_is_out_of_reach_of_the_heads() {
        let at = |diameter_m: f64, x_m: f64, sd_m: f64, verdict: Verdict, flagged: bool| {
            alone(9, |section| {
                (section.hole, section.hole_sd_m) = (Some(hole(diameter_m, x_m)), sd_m);
                (section.verdict, section.settled) = (verdict, false);
                section.flagged = flagged.then_some(MonoNs(1));
            })
        };
        let open = Verdict::Open;
        assert_eq!(at(0.6, 2.3, 0.0, open, false), [(9, false)], "the whole hole is out of reach");
        assert_eq!(at(2.0, 2.9, 0.0, open, false), [(9, false)], "0.7 m of the hole is out of reach");
        assert_eq!(at(2.0, 2.9, 0.15, open, false), [(9, true)], "0.4 m is out of reach for certain");
        assert_eq!(at(2.0, 3.1, 0.0, open, false), [(9, true)], "0.3 m of the hole is out of reach");
        assert_eq!(at(2.0, 2.9, 0.0, Verdict::CannotSay, false), [], "the section is not open");
        assert_eq!(at(2.0, 3.1, 0.0, open, true), [], "the section is already flagged");
    }

    const PERIMETER_M: f64 = 6.0 * core::f64::consts::PI;

    /// Whether a section is certain to fail because of an empty circle of radius `circle_m`, in a pipe of 3 m radius.
    ///
    /// The circle lies beside the vehicle (`is_beside`) or above it. The two errors are the standard deviations of
    /// chainage and yaw from pass to pass. Samples may still land from the chainage `to_come_m` on. Before 9 m, some
    /// heads have not passed the wall.
    fn fails(circle_m: f64, is_beside: bool, [along_m, yaw_rad]: [f64; 2], to_come_m: f64) -> bool {
        let profile = shapes::circle(3.0).unwrap();
        let [y_m, z_m] = profile.reference();
        let arc_m = profile.arc_of(if is_beside { [y_m + 3.0, z_m] } else { [y_m, z_m + 3.0] });
        let layout =
            StoreLayout { perimeter_m: PERIMETER_M, from_m: 0.0, to_m: 20.0, cell_m: 0.25, capacity: 40_000 };
        let mut store = SampleStore::new(layout);
        let mut put = |x_m: f64, arc_m: f64| {
            store.insert(WallSample { x_m, arc_m, head: 0, step_m: None, visit: 0 }).unwrap();
        };
        for (i, k) in (-20..=20).flat_map(|i| (0..188).map(move |k| (i, k))) {
            let (x_m, around_m) = (0.1 * f64::from(i), PERIMETER_M / 188.0 * f64::from(k));
            let off_m = math::hypot(x_m, math::wrap_signed(around_m, PERIMETER_M));
            if off_m > circle_m {
                put(10.125 + x_m, arc_m + around_m);
            }
        }
        for k in 0..90 {
            let (sin, cos) = math::sin_cos(math::TAU / 90.0 * f64::from(k));
            put(10.125 + circle_m * cos, arc_m + circle_m * sin);
        }
        let mut sections = Sections::new(0.25, Target { confidence_sd: 3.0, ..Target::new(0.5) }, 0.0, 20.0);
        let passage = &mut sections.get_mut(40).unwrap().passage;
        let (along, yaw) = (along_m * along_m, yaw_rad * yaw_rad);
        let relative = Relative::new([[along, 0.0, 0.0], [0.0; 3], [0.0, 0.0, yaw]]);
        (passage.placed, passage.pass_error) = (1, PassError { relative, from_m: [y_m, z_m] });
        let request = Request {
            section: 40,
            at: MonoNs(0),
            swept_by_all: None,
            none_alive: false,
            to_come: Some(Reach { from_m: to_come_m, to_m: f64::INFINITY }),
            not_passed: Some(Reach { from_m: f64::NEG_INFINITY, to_m: 9.0 }),
            ended: None,
            only_fails: true,
        };
        let mut judging = Judging {
            store: &store,
            missing_samples: &MissingSamples::default(),
            finder: &mut HoleFinder::default(),
            profile: &profile,
            tell: &mut |_, _| {},
        };
        let everywhere = Request { not_passed: None, ..request };
        assert!(
            !sections.fails_already(&everywhere, &mut judging),
            "without a stretch that some heads have not passed, the section does not fail early"
        );
        sections.fails_already(&request, &mut judging)
    }

    /// The diameter of a circle must exceed the target of 0.5 m by three standard deviations.
    ///
    /// The error of a hole is 1.2 times the error of a pass.
    #[test]
    fn size_limit_of_an_empty_circle_includes_the_position_error_at_its_place() {
        for is_beside in [true, false] {
            let fails = |circle_m: f64, errors: [f64; 2]| fails(circle_m, is_beside, errors, 10.9);
            assert!(!fails(0.245, [0.0; 2]) && fails(0.255, [0.0; 2]), "the circle must exceed the target");
            // The limit is 0.5 m plus three standard deviations of 0.06 m.
            assert!(!fails(0.335, [0.05, 0.0]) && fails(0.345, [0.05, 0.0]));
        }
        // A yaw of 0.02 rad moves wall 3 m beside the vehicle by 0.06 m, and does not move wall above it. So the limit
        // beside the vehicle is 0.5 m plus three standard deviations of 0.072 m.
        assert!(!fails(0.35, true, [0.0, 0.02], 10.9) && fails(0.365, true, [0.0, 0.02], 10.9));
        assert!(fails(0.265, false, [0.0, 0.02], 10.9));
        for (to_come_m, yaw_rad) in
            [10.9, 10.45].into_iter().flat_map(|x_m| [0.0, 0.06, 0.1].map(|yaw| (x_m, yaw)))
        {
            // A yaw error does not move the wall above the vehicle, so a circle of 0.265 m radius suffices there.
            // Beside the vehicle, it would have to be far larger.
            assert!(fails(0.265, false, [0.0, yaw_rad], to_come_m), "{to_come_m} {yaw_rad}");
        }
        assert!(!fails(0.3, true, [0.0; 2], 10.3), "samples may still land in the circle");
    }
}
