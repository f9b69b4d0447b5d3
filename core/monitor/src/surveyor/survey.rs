//! State that changes while the surveyor processes the georeferenced pings of a tick, and the results.

use bevy_ecs::prelude::{Res, ResMut, Resource};
use bevy_ecs::system::SystemParam;

use super::driving::Driving;
use super::position_gaps::PositionGaps;
use crate::alert_list::RunInput;
use crate::merge::MAX_TICK_PACKETS;
use crate::messages::{Notice, Standing};
use crate::observations::Observations;
use crate::resources::{Coverage, Digests, Plan, Tally};
use headrace_coverage::Request;

/// Maximum number of missed stretches that change when one section is judged: its own stretch and two
/// neighbours.
const RUNS_EACH: usize = 3;
/// Maximum number of notices per judged section: one for the section, and one for each changed missed
/// stretch.
const NOTICES_EACH: usize = 1 + RUNS_EACH;

/// Position of the surveyor in the tick's list of georeferenced pings and advice updates.
#[derive(Debug, Clone, Copy, Default, Resource)]
pub(super) struct Cursor {
    /// Index of the next ping or advice update to process.
    pub(super) next: usize,
    /// Index of the reading at which processing has stopped, and whether it stopped at an advice update
    /// before that reading.
    pub(super) stop: (usize, bool),
}

/// Requests for sections to be judged, in order.
#[derive(Debug, Resource)]
pub(super) struct Requests(pub(super) Vec<Request>);

/// Results of the surveyor in a tick.
#[derive(Debug, Resource)]
pub struct Found {
    /// Length of each verdict and observations that hold, at each advice update, in order.
    pub standings: Vec<Standing>,
    /// Changed missed stretches, in order.
    pub(crate) runs: Vec<RunInput>,
    /// Notices of changed sections and missed stretches, in order.
    pub notices: Vec<Notice>,
}

impl Found {
    /// Lists with room for all sections. Allocates: all memory of the lists.
    pub(super) fn with_room(sections: usize) -> Self {
        // A jump along the tunnel may make all sections due for judging at once.
        let most = sections + MAX_TICK_PACKETS;
        Self {
            standings: Vec::with_capacity(MAX_TICK_PACKETS),
            runs: Vec::with_capacity(RUNS_EACH * most),
            notices: Vec::with_capacity(NOTICES_EACH * most),
        }
    }

    pub(super) fn clear(&mut self) {
        self.standings.clear();
        self.runs.clear();
        self.notices.clear();
    }
}

/// The wall's coverage, and all other state that changes while georeferenced pings are processed.
#[derive(SystemParam)]
pub(super) struct Survey<'w> {
    pub(super) coverage: ResMut<'w, Coverage>,
    pub(super) driving: ResMut<'w, Driving>,
    pub(super) requests: ResMut<'w, Requests>,
    pub(super) tally: ResMut<'w, Tally>,
    pub(super) gaps: ResMut<'w, PositionGaps>,
    pub(super) cursor: ResMut<'w, Cursor>,
    pub(super) plan: Res<'w, Plan>,
}

/// Lists and streams to which the surveyor adds its results.
#[derive(SystemParam)]
pub(super) struct Outputs<'w> {
    pub(super) found: ResMut<'w, Found>,
    pub(super) digests: ResMut<'w, Digests>,
    pub(super) observations: ResMut<'w, Observations>,
}

/// Mutable references to the fields of [`Outputs`].
pub(super) struct OutputRefs<'a> {
    pub(super) notices: &'a mut Vec<Notice>,
    pub(super) runs: &'a mut Vec<RunInput>,
    pub(super) digests: &'a mut Digests,
    pub(super) observations: &'a mut Observations,
}

impl Outputs<'_> {
    pub(super) fn refs(&mut self) -> OutputRefs<'_> {
        let Found { runs, notices, .. } = &mut *self.found;
        OutputRefs { notices, runs, digests: &mut self.digests, observations: &mut self.observations }
    }
}
