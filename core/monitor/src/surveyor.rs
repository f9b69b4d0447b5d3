//! The surveyor: the world that converts georeferenced pings to samples, passes, verdicts on sections, and
//! missed stretches.
//!
//! Its entities are the heads.

#![allow(clippy::needless_pass_by_value, reason = "bevy hands systems their arguments by value")]

mod classify;
mod count;
mod coverage_extent;
mod driving;
mod due;
mod heads;
mod judge;
mod missing_samples;
mod navigation_doubts;
mod passages;
mod position_gaps;
mod samples;
mod standing;
mod survey;
mod walk;
mod wall;

use std::sync::Arc;

use bevy_ecs::prelude::Resource;

use super::entities::{HeadClassifier, HeadEntities, HeadFrontier, HeadSweep};
use super::error::PluginError;
use super::merge::MAX_TICK_PACKETS;
use super::observations::Observations;
use super::part::Part;
use super::placer::{Placed, PlacedTick};
use super::resources::{Coverage, Digests, Finder, Tally};
use super::stage::SurveyStage;
use classify::{Classified, NearWall};
use driving::Driving;
use headrace_coverage::{Outlook, Request};
use headrace_geometry::snapshot::{Restorer, Saver, SnapshotError};
use headrace_geometry::time::MonoNs;
pub use position_gaps::{PositionGap, PositionGaps};
pub use survey::Found;
use survey::{Cursor, Requests};

/// Part of the loop that converts georeferenced pings to verdicts.
pub struct Surveyor {
    part: Part<SurveyStage>,
    /// Empty placer results. The surveyor holds them between two ticks, in place of the results of a tick.
    nothing: Arc<Placed>,
}

impl Surveyor {
    /// Creates the surveyor from a world that has heads, tunnel and target.
    ///
    /// Errors: the order of two systems is ambiguous.
    pub(super) fn new(
        mut part: Part<SurveyStage>,
        coverage: Coverage,
        finder: Finder,
        keeps_results: bool,
    ) -> Result<Self, PluginError> {
        let sections = coverage.sections.len();
        let mut digests = Digests::default();
        if keeps_results {
            digests.pings.keep();
            digests.judgements.keep();
        }
        part.insert_state("streams of the surveyor", digests);
        let nothing = Arc::default();
        part.insert_resource(PlacedTick(Arc::clone(&nothing)));
        part.insert_resource(Classified::with_room());
        part.insert_resource(Cursor::default());
        part.insert_resource(Requests(Vec::with_capacity(sections + MAX_TICK_PACKETS)));
        part.insert_resource(Found::with_room(sections));
        part.add_component_state::<HeadClassifier>("classifiers");
        part.add_component_state::<HeadSweep>("sweeps");
        part.add_component_state::<HeadFrontier>("reach of heads");
        part.insert_state("relief", NearWall::default());
        part.insert_state("driving", Driving::default());
        part.insert_state("position gaps", PositionGaps::with_room());
        part.insert_state("coverage", coverage);
        part.insert_state("search for holes", finder);
        part.insert_state("observations", Observations::default());
        part.insert_state("tally", Tally::default());
        part.add_systems(SurveyStage::Classify, classify::classify_returns);
        part.add_systems(SurveyStage::Walk, walk::walk);
        part.add_systems(SurveyStage::Judge, judge::judge_due);
        part.add_systems(SurveyStage::Report, standing::report_standing);
        part.initialize()?;
        Ok(Self { part, nothing })
    }

    /// Processes the georeferenced pings of a tick. Allocates: never.
    pub(super) fn tick(&mut self, placed: &Arc<Placed>) {
        let Self { part, nothing } = self;
        part.world.resource_mut::<Found>().clear();
        *part.world.resource_mut::<Cursor>() = Cursor::default();
        part.world.resource_mut::<PlacedTick>().0 = Arc::clone(placed);
        if !placed.items.is_empty() {
            part.run(SurveyStage::Classify);
        }
        while part.world.resource::<Cursor>().next < placed.items.len() {
            for stage in SurveyStage::OF_STOP {
                part.run(stage);
            }
        }
        part.run(SurveyStage::Surveyed);
        part.world.resource_mut::<PlacedTick>().0 = Arc::clone(nothing);
        debug_assert_eq!(self.found().standings.len(), placed.updates().count(), "a standing at each update");
    }

    /// Clears the results of the last tick from the streams.
    pub(super) fn next_tick(&mut self) {
        self.part.world.resource_mut::<Digests>().next_tick();
    }

    /// Results of the surveyor in the last tick.
    pub fn found(&self) -> &Found {
        self.part.world.resource()
    }

    /// Coverage of the wall, with samples and verdicts.
    pub fn coverage(&self) -> &Coverage {
        self.part.world.resource()
    }

    /// Counts of pings over the whole dive.
    pub fn tally(&self) -> &Tally {
        self.part.world.resource()
    }

    /// Stretches of the dive without a position.
    pub fn position_gaps(&self) -> &PositionGaps {
        self.part.world.resource()
    }

    /// Observations about the dive as a whole.
    pub(super) fn observations(&self) -> &Observations {
        self.part.world.resource()
    }

    /// Result streams of the surveyor.
    pub fn digests(&self) -> &Digests {
        self.part.world.resource()
    }

    /// A resource that a plugin has added.
    pub fn resource<T: Resource>(&self) -> Option<&T> {
        self.part.resource()
    }

    /// Outlook at a time: where samples have landed and where they may still land.
    pub(super) fn outlook(&self, at: MonoNs) -> Outlook {
        let world = &self.part.world;
        let heads = world.resource::<HeadEntities>().0.iter();
        let reaches = heads.filter_map(|head| world.get::<HeadFrontier>(*head)?.0);
        self.coverage().frontier.outlook(reaches, at)
    }

    /// Classifies the returns that still wait at the end of a dive, when no more returns will come. Allocates.
    pub(super) fn end_returns(&mut self) {
        self.part.world.resource_mut::<Found>().clear();
        wall::end_returns(&mut self.part.world);
    }

    /// Returns the sections to judge at the end of a dive, and a request that fits all of them except for its section.
    pub(super) fn open_requests(&mut self, at: MonoNs) -> (Vec<i64>, Option<Request>) {
        let outlook = self.outlook(at);
        let (mut open, mut common) = (Vec::new(), None);
        let mut ask = |request: Request| {
            open.push(request.section);
            common = Some(request);
        };
        self.part.world.resource_mut::<Coverage>().sections.unsettled(&outlook, &mut ask);
        (open, common)
    }

    /// Judges a section at the end of a dive.
    pub(super) fn judge_at_end(&mut self, request: Request) {
        let Self { part, .. } = self;
        part.world.resource_mut::<Found>().clear();
        *part.world.resource_mut::<Cursor>() = Cursor::default();
        part.world.resource_mut::<Requests>().0.push(request);
        part.run(SurveyStage::Judge);
    }

    /// Frees the memory of the samples.
    pub(super) fn release_samples(&mut self) {
        self.part.world.resource_mut::<Coverage>().store.release();
    }

    pub(super) fn save(&self, to: &mut Saver) {
        self.part.save(to);
    }

    pub(super) fn restore(&mut self, from: &mut Restorer<'_>) -> Result<(), SnapshotError> {
        self.part.restore(from)
    }
}

#[cfg(test)]
mod tests {
    use core::any::TypeId;

    use super::*;
    use crate::entities::{Head, HiddenAngles, Mounted};
    use crate::fixtures::armed;
    use crate::resources::{Plan, TunnelDesign};

    /// The types listed here are constant after arming, or are set anew in each tick, so snapshots omit them.
    #[test]
    fn snapshots_contain_all_state_of_the_surveyor() {
        let dive = armed();
        dive.view().surveyor().part.has_state_but_for(&[
            TypeId::of::<Head>(),
            TypeId::of::<HeadEntities>(),
            TypeId::of::<HiddenAngles>(),
            TypeId::of::<Mounted>(),
            TypeId::of::<Plan>(),
            TypeId::of::<TunnelDesign>(),
            TypeId::of::<Classified>(),
            TypeId::of::<Cursor>(),
            TypeId::of::<Found>(),
            TypeId::of::<PlacedTick>(),
            TypeId::of::<Requests>(),
        ]);
    }
}
