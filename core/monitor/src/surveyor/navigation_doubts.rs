//! Records the doubts that navigation reports.

use super::heads::Heads;
use super::judge::digest_observation;
use super::survey::OutputRefs;
use crate::messages::Doubts;
use crate::observations::{ObservedKind, Occurrence};
use crate::resources::Coverage;
use headrace_coverage::Reach;
use headrace_fusion::filter::cable::CableDoubt;
use headrace_geometry::time::MonoNs;
use headrace_sampling::passes::Situation;
use headrace_sensor::reading::SourceId;

/// Records the doubts reported at an advice update.
///
/// Returns the range of chainages, m, in which samples come from a head with a wrong mount; `None` if there is no
/// such head. When the doubt begins, the range is the whole coverage extent.
pub(super) fn note(
    (at, situation, doubts): (MonoNs, &Situation, &Doubts),
    (coverage, heads): (&Coverage, &Heads<'_, '_>),
    outputs: &mut OutputRefs<'_>,
) -> Option<[f64; 2]> {
    let OutputRefs { digests, observations, .. } = outputs;
    if let Some(CableDoubt { since, from_m, differs_m, log }) = doubts.cable {
        let (kind, occurrence) = (ObservedKind::CableDoubted, Occurrence { x_m: from_m, off_m: differs_m });
        if observations.note_lasting(log, kind, since, occurrence) {
            digest_observation(digests, kind, log, at, occurrence);
        }
    }
    let x_m = situation.pose.map(|pose| pose.position.x());
    let (doubt, x_m) = doubts.setting.zip(x_m)?;
    let is_new = observations.note_setting(at, x_m, &doubt);
    if is_new {
        let occurrence = Occurrence { x_m, off_m: doubt.setting.figure() };
        digest_observation(digests, ObservedKind::SettingDoubted, None, at, occurrence);
    }
    let source = doubt.source.filter(|_| doubt.setting.is_of_pointing()).map(SourceId);
    let is_head = heads.iter().any(|(_, mounted, ..)| Some(mounted.source) == source);
    if !is_head || heads.iter().len() < 2 {
        return None;
    }
    let here = || {
        heads.iter().filter_map(|(.., frontier)| frontier.0).map(|reach| reach.latest()).reduce(Reach::with)
    };
    let reach = if is_new { coverage.frontier.way() } else { here() };
    reach.map(|reach| [reach.from_m, reach.to_m])
}

#[cfg(test)]
mod tests {
    use super::super::survey::{Found, Outputs};
    use super::*;
    use crate::entities::{Head, HeadFrontier, HeadSweep, HiddenAngles, Mounted};
    use crate::fixtures::{coverage, mount, situation};
    use crate::observations::Observations;
    use crate::resources::Digests;
    use bevy_ecs::system::SystemState;
    use bevy_ecs::world::World;
    use headrace_coverage::{HeadReach, Reach};
    use headrace_fusion::filter::setting_check::{Setting, SettingDoubt};
    use headrace_sensor::device::{SensorInfo, SensorKind};

    /// Chainages suspected at two successive updates because of a setting of `source`. The heads are sources 0 and up,
    /// at 9 to 10 m now; the coverage extent begins at 2 m.
    fn suspected(heads: u16, setting: Setting, source: Option<u16>) -> [Option<[f64; 2]>; 2] {
        let (mut world, mut coverage) = (World::new(), coverage());
        let reach = |from_m: f64, to_m: f64| Reach { from_m, to_m };
        for source in (0..heads).map(SourceId) {
            let info = SensorInfo { mount: mount(), kind: SensorKind::Head };
            let frontier = HeadFrontier(Some(HeadReach::after(None, MonoNs(0), reach(9.0, 10.0))));
            let head = Head(source.index());
            world.spawn((
                head,
                Mounted { source, info },
                HiddenAngles::default(),
                HeadSweep::default(),
                frontier,
            ));
        }
        for here in [reach(2.0, 3.0), reach(9.0, 10.0)] {
            let heads = core::iter::once(HeadReach::after(None, MonoNs(0), here));
            coverage.frontier.advance(here, heads, MonoNs(0), 0.25, 0.25);
        }
        world.insert_resource(Found::with_room(0));
        world.insert_resource(Digests::default());
        world.insert_resource(Observations::default());
        let mut state = SystemState::<(Heads<'_, '_>, Outputs<'_>)>::new(&mut world);
        let setting = Some(SettingDoubt { setting, source, sure_sd: 7.0 });
        let doubts = Doubts { cable: None, setting, unverified_mounts: false, stand_s: 0, hung: 0 };
        [MonoNs(1), MonoNs(2)].map(|at| {
            let (heads, mut outputs) = state.get_mut(&mut world).unwrap();
            note((at, &situation(Some(9.5)), &doubts), (&coverage, &heads), &mut outputs.refs())
        })
    }

    /// All samples of a head that points elsewhere are displaced: first the samples of the whole dive, then the new
    /// samples.
    #[test]
    fn samples_of_a_head_that_points_elsewhere_are_suspected_from_the_beginning() {
        for setting in [Setting::HeadYawed(0.05), Setting::HeadPitched(-0.05), Setting::WrongWayRound] {
            assert_eq!(suspected(2, setting, Some(1)), [Some([2.0, 10.0]), Some([9.0, 10.0])], "{setting:?}");
            assert_eq!(
                suspected(1, setting, Some(0)),
                [None; 2],
                "a single head displaces all samples alike"
            );
            assert_eq!(suspected(2, setting, Some(2)), [None; 2], "{setting:?} of an echosounder");
        }
        assert_eq!(suspected(2, Setting::HeadTurned(0.05), Some(1)), [None; 2]);
        assert_eq!(suspected(2, Setting::RangeScale(0.04), None), [None; 2]);
    }
}
