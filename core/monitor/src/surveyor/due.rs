//! Finds the sections that are due for judging.

use super::heads::Heads;
use super::survey::Requests;
use crate::messages::PlacedPing;
use crate::resources::Coverage;
use headrace_coverage::{HeadReach, Request};
use headrace_geometry::time::{DurNs, MonoNs};

/// Interval at which the sections around the vehicle are judged even if the vehicle has not moved.
const LOOK_AROUND: DurNs = DurNs(1_000_000_000);

/// Once a second, requests judging of the sections around the vehicle.
pub(super) fn look_around(
    coverage: &mut Coverage,
    heads: &Heads<'_, '_>,
    at: MonoNs,
    requests: &mut Requests,
) {
    if at.0.is_multiple_of(LOOK_AROUND.0.unsigned_abs()) {
        let reaches = heads.iter().filter_map(|(.., frontier)| frontier.0);
        let outlook = coverage.frontier.outlook(reaches, at);
        coverage.sections.look_around(&outlook, &mut |request| requests.0.push(request));
    }
}

/// Requests judging of the sections between these chainages, m, whose samples come from a head that is no
/// longer trusted.
pub(super) fn suspect(
    coverage: &mut Coverage,
    [from_m, to_m]: [f64; 2],
    (heads, at): (&Heads<'_, '_>, MonoNs),
    requests: &mut Requests,
) {
    let reaches = heads.iter().filter_map(|(.., frontier)| frontier.0);
    let outlook = coverage.frontier.outlook(reaches, at);
    let sections = &mut coverage.sections;
    for index in sections.index_of(from_m)..=sections.index_of(to_m) {
        let Some(section) = sections.get_mut(index) else { continue };
        if section.suspect() && section.hole.is_some() {
            requests.0.push(Request::at(&outlook)(index));
        }
    }
}

/// Updates the chainages where samples may still land, and requests judging of the sections that are due.
pub(super) fn note_frontier(
    coverage: &mut Coverage,
    heads: impl Iterator<Item = HeadReach> + Clone,
    ping: &PlacedPing,
    requests: &mut Requests,
) {
    let Coverage { sections, frontier, .. } = coverage;
    let Some(reach) = ping.reach else { return };
    let moved =
        frontier.advance(reach, heads.clone(), ping.received, sections.section_m(), sections.left_m());
    if sections.may_be_due(&moved) {
        let outlook = frontier.outlook(heads, ping.received);
        sections.due(&moved, &outlook, &mut |request| requests.0.push(request));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::coverage;
    use bevy_ecs::system::SystemState;
    use bevy_ecs::world::World;

    /// Sections with samples of a distrusted head are judged again if they were judged before.
    #[test]
    fn judged_sections_with_samples_of_a_distrusted_head_are_judged_again() {
        let mut coverage = coverage();
        let hole = headrace_coverage::Hole {
            diameter_m: 0.3,
            least_m: 0.3,
            most_m: 0.3,
            x_m: 5.1,
            arc_m: 1.0,
            bounded: true,
        };
        for index in [19, 21, 23] {
            coverage.sections.get_mut(index).unwrap().hole = Some(hole);
        }
        let mut requests = Requests(Vec::new());
        let mut world = World::new();
        let mut state = SystemState::<Heads<'_, '_>>::new(&mut world);
        let heads = state.get_mut(&mut world).unwrap();
        suspect(&mut coverage, [5.1, 5.8], (&heads, MonoNs(7)), &mut requests);
        let suspects = (0..40).filter(|index| coverage.sections.get(*index).unwrap().suspect);
        assert_eq!(suspects.collect::<Vec<_>>(), [20, 21, 22, 23]);
        let asked = requests.0.iter().map(|request| (request.section, request.at, request.only_fails));
        assert_eq!(asked.collect::<Vec<_>>(), [(21, MonoNs(7), false), (23, MonoNs(7), false)]);
    }
}
