//! Decides which returns are wall.
//!
//! A decision depends on the head's earlier returns and on the wall nearby, but on no verdict. All returns of
//! a tick are therefore classified at once.

use bevy_ecs::prelude::{Query, Res, ResMut, Resource};

use crate::entities::{HeadClassifier, HeadEntities};
use crate::messages::{Outcome, PlacedPing, Placement};
use crate::placer::{MAX_TICK_READINGS, PlacedTick};
use crate::resources::TunnelDesign;
use headrace_coverage::deviation::off_m;
use headrace_coverage::{Beam, Distrust, HeadWall, PlacedReturn, Relief, Sorted};
use headrace_geometry::math;
use headrace_geometry::snapshot::{Restorer, Saver, SnapshotError, Stateful};
use headrace_sampling::head::MAX_HEADS;

/// Places near the vehicle at which the wall deviates from the design profile.
#[derive(Debug, Default, Resource)]
pub(crate) struct NearWall(pub(crate) Relief);

impl Stateful for NearWall {
    fn save(&self, to: &mut Saver) {
        self.0.save(to);
    }

    fn restore(&mut self, from: &mut Restorer<'_>) -> Result<(), SnapshotError> {
        self.0.restore(from)
    }
}

/// Classification of a georeferenced ping or of an advice update.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Class {
    /// A ping without a return that could be georeferenced.
    NoReturn,
    /// A return, and whether its head is distrusted afterwards.
    Return(Sorted, bool),
    /// An advice update: for each head, the reason for distrusting it at that time, if any.
    Update([Option<Distrust>; MAX_HEADS]),
}

/// Classification of each georeferenced ping and advice update of the tick, in order.
#[derive(Debug, Resource)]
pub(crate) struct Classified(pub(crate) Vec<Class>);

impl Classified {
    /// Creates an empty list of classifications. Allocates: all memory of the list.
    pub(crate) fn with_room() -> Self {
        Self(Vec::with_capacity(2 * MAX_TICK_READINGS))
    }
}

pub(crate) fn classify_returns(
    placed: Res<'_, PlacedTick>,
    tunnel: Res<'_, TunnelDesign>,
    entities: Res<'_, HeadEntities>,
    mut heads: Query<'_, '_, &mut HeadClassifier>,
    mut near: ResMut<'_, NearWall>,
    mut classified: ResMut<'_, Classified>,
) {
    classified.0.clear();
    for item in &placed.items {
        classified.0.push(match &item.placement {
            Placement::Update(_) => {
                let distrusted = |head: usize| heads.get(entities.of_head(head)?).ok()?.0.distrusted();
                Class::Update(core::array::from_fn(distrusted))
            }
            Placement::Ping(ping) => {
                let head = entities.of_head(ping.head).and_then(|entity| heads.get_mut(entity).ok());
                debug_assert!(
                    head.is_some(),
                    "head {} of a placed ping is unknown to the surveyor",
                    ping.head
                );
                head.map_or(Class::NoReturn, |mut head| classify(&mut head.0, ping, &tunnel, &mut near.0))
            }
        });
    }
    debug_assert_eq!(classified.0.len(), placed.items.len());
}

/// Classifies a ping's return, and the head's earlier returns that waited for this ping.
pub(super) fn classify(
    head: &mut HeadWall,
    ping: &PlacedPing,
    tunnel: &TunnelDesign,
    relief: &mut Relief,
) -> Class {
    let (Outcome::Sample { point, arc_m }, Some(origin)) = (ping.outcome, ping.origin) else {
        return Class::NoReturn;
    };
    let profile = &tunnel.profile;
    let (from, to) = ([origin.y(), origin.z()], [point.y(), point.z()]);
    let beam = [to[0] - from[0], to[1] - from[1]];
    let range_m = math::hypot(beam[0], beam[1]);
    let placed = PlacedReturn { x_m: point.x(), arc_m, off_m: off_m(profile, to, arc_m) };
    let had = Beam {
        range_m,
        angle_rad: math::atan2(beam[0], -beam[1]),
        standing: ping.standing,
        design_range_m: &|| {
            let beam = (range_m > 0.0).then(|| beam.map(|of| of / range_m))?;
            Some(profile.cast(from, beam)?.range_m)
        },
    };
    let sorted = head.sort(ping.head, placed, &had, &tunnel.limits, relief);
    Class::Return(sorted, head.distrusted().is_some())
}
