//! Live messages about a dive. Each situation is reported once, neighbouring sections as one stretch.
//!
//! The end of a stretch is reported once it is known. The terminal and `--json-lines` print these messages.
//! Allocates: outlets only, never within a tick.

use serde::Serialize;

use super::alert_list::{AlertChange, AlertState, Figures, ListedAlert, ListedAlertJson, NoteJson};
use super::live_state::LiveState;
use super::messages::Notice;
use super::pilot_text::Missed;
use super::run::Loop;
pub use super::unsure_stretch::UnsureStretch;
use headrace_coverage::{
    Cause, Causes, Evidence, Metres, Run, RunChange, RunId, Section, Sections, Stretch, Unsure, Verdict,
};
use headrace_fusion::filter::setting_check::SettingDoubt;
use headrace_geometry::math::TAU;
use headrace_geometry::time::{DurNs, MonoNs};

/// Time between two messages on the coverage extent and the length of each verdict in it, in data time.
const WAY_EVERY: DurNs = DurNs(60_000_000_000);

/// A further cause of a missed stretch is reported only if it applies to at least this length, m.
const LASTS_M: f64 = 1.0;

/// A live message. The field names are the contract of `--json-lines`. Lengths are in m.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(tag = "type", rename_all = "snake_case")]
pub enum LiveMessage {
    /// Sections were missed. If a missed stretch continues with another cause, the message is
    /// repeated from the first section with that cause.
    Flag {
        /// Number of the missed stretch.
        run: u32,
        /// Beginning of the stretch with this cause, m.
        from_m: f64,
        /// Main cause of the miss.
        cause: Cause,
        /// All causes of the miss.
        causes: Causes,
        /// Figures for the text of the message.
        #[serde(skip)]
        missed: Missed,
    },
    /// The end of the most recently flagged missed stretch is known.
    FlagEnds {
        /// Number of the missed stretch.
        run: u32,
        /// Beginning of the missed stretch.
        from_m: f64,
        /// End of the missed stretch.
        to_m: f64,
        /// Length of the stretch's sections that fail at present.
        failed_m: f64,
    },
    /// The vehicle has driven through a missed stretch again, and none of its sections fails any more.
    Cleared {
        /// Number of the missed stretch.
        run: u32,
        /// Beginning of the cleared stretch.
        from_m: f64,
        /// End of the cleared stretch.
        to_m: f64,
    },
    /// A stretch without a verdict has begun.
    CannotSay(UnsureStretch),
    /// The end of a stretch without a verdict is known.
    CannotSayEnds(UnsureStretch),
    /// Some heads have not been at the place where the vehicle began or turned back, and the vehicle is now well away
    /// from this place.
    NotInspected(UnsureStretch),
    /// An alert has changed.
    AlertChange {
        /// Kind of the alert's change.
        change: AlertChange,
        /// The alert as it was at the time of the change.
        alert: Box<ListedAlertJson>,
    },
    /// A note was added.
    Note(NoteJson),
    /// The present coverage extent, with the length of each verdict in it.
    Way {
        /// Beginning of the extent.
        from_m: f64,
        /// End of the extent.
        to_m: f64,
        /// Length of each verdict within the extent.
        metres: Metres,
    },
}

/// Converts the loop's notices to live messages.
///
/// A dive has one converter. All readers share its messages.
#[derive(Debug, Default)]
pub struct LiveMessages {
    /// The most recently flagged missed stretch, with its reported causes, until its end is reported.
    run: Option<(RunId, Causes)>,
    /// Stretches reported as missed, as long as any of their sections fails.
    missed: Vec<ReportedMiss>,
    /// Last reported stretch without a verdict, until its end is reported.
    unsure: Option<Stretch>,
    /// Whether the stretch without a verdict was reported with its hole's error, and not the hole's size, as the
    /// reason.
    reported_as_error: bool,
    /// Stretches without a verdict whose ends were reported.
    reported: Vec<Stretch>,
    /// Sections at an end of the coverage extent. Their message is held back until the vehicle is well away
    /// from them.
    at_ends: Option<Stretch>,
    /// Number of the alert for the last reported doubtful setting, and that setting.
    setting: Option<(u32, SettingDoubt)>,
    way_told: Option<MonoNs>,
    /// End of the last tick whose messages were reported.
    played: Option<MonoNs>,
}

/// A reported miss: index of the first section that ever failed, and index after the last one.
#[derive(Debug, Clone, Copy)]
struct ReportedMiss {
    run: RunId,
    from: i64,
    to: i64,
}

impl ReportedMiss {
    fn meets(&self, run: &Run) -> bool {
        run.from < self.to && run.to > self.from
    }
}

impl LiveMessages {
    /// Resets all state after a jump of the playback. After a jump, `now` differs from the end of the last tick
    /// that was played.
    ///
    /// After a mere pause, the messages continue.
    pub fn stopped(&mut self, now: MonoNs) {
        if self.played != Some(now) {
            *self = Self::default();
        }
    }

    /// Processes a notice, and calls `tell` with the messages that result.
    pub fn hear(&mut self, notice: &Notice, dive: &Loop, tell: &mut dyn FnMut(LiveMessage)) {
        match notice {
            Notice::Advice(_) => {}
            Notice::Listed { change, at, alert } => {
                if let Figures::Setting(doubt, _) = alert.figures {
                    self.setting = Some((alert.number, doubt));
                }
                tell(alert_change(*change, alert, *at, dive));
            }
            Notice::Note(note) => tell(LiveMessage::Note(NoteJson::of(note, dive.view().clock()))),
            Notice::Section { section, .. } => {
                let sections = &dive.view().coverage().sections;
                self.close_run_at(*section, sections, tell);
                self.note_unsure(*section, sections, tell);
            }
            Notice::Run { id, change, .. } => self.run(*id, *change, dive, tell),
        }
    }

    /// Reports any messages that the live state requires, after every tick.
    pub fn tick(&mut self, state: &LiveState, dive: &Loop, tell: &mut dyn FnMut(LiveMessage)) {
        self.played = Some(dive.now());
        let Some(at) = state.at else { return };
        self.tell_other_setting(at, dive, tell);
        let sections = &dive.view().coverage().sections;
        // The interval begins at the first advice update, when there is nothing to report.
        let since = *self.way_told.get_or_insert(at);
        if at.since(since).0.abs() >= WAY_EVERY.0 && state.metres.way_m() > 0.0 {
            self.way_told = Some(at);
            let range = sections.sections_of(dive.view().coverage().frontier.way());
            let (from_m, to_m) = (sections.bounds_m(range.start).0, sections.bounds_m(range.end).0);
            tell(LiveMessage::Way { from_m, to_m, metres: state.metres });
        }
        // Diameter of the circle that has the tunnel's perimeter.
        let width_m = 2.0 * dive.mission().profile.perimeter_m() / TAU;
        if let (Some(ends), Some(x_m)) = (self.at_ends, state.chainage_m) {
            let off_m = (sections.bounds_m(ends.from).0 - x_m).max(x_m - sections.bounds_m(ends.to).0);
            if off_m > width_m {
                self.tell_ends(sections, tell);
            }
        }
    }

    /// Reports the ends of the stretches that last until the end of a dive.
    pub fn end(&mut self, sections: &Sections, tell: &mut dyn FnMut(LiveMessage)) {
        self.close_run(sections, tell);
        self.close_unsure(sections, tell);
    }

    /// Reports that the doubtful setting has changed to another one. The alert stays active, so no notice
    /// reports this change.
    fn tell_other_setting(&mut self, at: MonoNs, dive: &Loop, tell: &mut dyn FnMut(LiveMessage)) {
        let doubted = dive.view().alert_list().iter().rev().find_map(|alert| match alert.figures {
            Figures::Setting(doubt, _) if alert.state == AlertState::Active => Some((alert, doubt)),
            _ => None,
        });
        let Some((alert, doubt)) = doubted else { return };
        let is_other =
            |(number, reported): (u32, SettingDoubt)| number == alert.number && !reported.is_of_same(&doubt);
        if self.setting.replace((alert.number, doubt)).is_some_and(is_other) {
            tell(alert_change(AlertChange::Changed, alert, at, dive));
        }
    }

    fn tell_ends(&mut self, sections: &Sections, tell: &mut dyn FnMut(LiveMessage)) {
        let Some(ends) = self.at_ends.take() else { return };
        // Some of the sections at an end may have been inspected in the meantime.
        let still = (ends.from..ends.to).filter_map(|index| sections.unsure(index));
        let mut still = still.filter(|here| here.why == Unsure::NotInspected);
        let Some(mut all) = still.next() else { return };
        for here in still {
            if !all.join(&here, sections.section_m()) {
                break;
            }
        }
        self.reported.push(all);
        tell(LiveMessage::NotInspected(UnsureStretch::of(&all, sections)));
    }

    fn note_unsure(&mut self, section: i64, sections: &Sections, tell: &mut dyn FnMut(LiveMessage)) {
        let section_m = sections.section_m();
        // A section at an end of the coverage extent is reported later, if it is still without a verdict
        // then.
        let is_settled = sections.get(section).is_some_and(|section| section.settled);
        let lasts = |here: &Stretch| is_settled || here.why == Unsure::NotInspected;
        let Some(here) = sections.unsure(section).filter(lasts) else {
            let is_judged = sections.get(section).is_some_and(|section| section.verdict != Verdict::Open);
            let is_over = |last: &Stretch| last.is_beyond(section..section + 1, section_m);
            if is_judged && self.unsure.as_ref().is_some_and(is_over) {
                self.close_unsure(sections, tell);
            }
            return;
        };
        let is_reported =
            |reported: &Stretch| reported.why == here.why && (reported.from..reported.to).contains(&section);
        // The pilot is passing a missed stretch again. Half a pass gives only an intermediate result, which
        // is not reported.
        let is_missed = |reported: &ReportedMiss| {
            here.why != Unsure::NotInspected && (reported.from..reported.to).contains(&section)
        };
        if self.reported.iter().any(is_reported) || self.missed.iter().any(is_missed) {
            return;
        }
        if here.why == Unsure::NotInspected {
            if !self.at_ends.as_mut().is_some_and(|ends| ends.join(&here, section_m)) {
                self.tell_ends(sections, tell);
                self.at_ends = Some(here);
            }
            return;
        }
        if let Some(last) = &mut self.unsure
            && (is_reported(last) || last.join(&here, section_m))
        {
            // The first sections of the stretch may lack a verdict for another reason than most of its
            // sections.
            if self.reported_as_error && !last.is_mostly_error() {
                self.reported_as_error = false;
                tell(LiveMessage::CannotSay(UnsureStretch::of(last, sections)));
            }
            return;
        }
        self.close_unsure(sections, tell);
        (self.unsure, self.reported_as_error) = (Some(here), here.is_mostly_error());
        tell(LiveMessage::CannotSay(UnsureStretch::of(&here, sections)));
    }

    fn close_unsure(&mut self, sections: &Sections, tell: &mut dyn FnMut(LiveMessage)) {
        if let Some(stretch) = self.unsure.take() {
            self.reported.push(stretch);
            tell(LiveMessage::CannotSayEnds(UnsureStretch::of(&as_it_is(&stretch, sections), sections)));
        }
    }

    /// Reports the end of the most recently flagged missed stretch once a section beyond it has a verdict other
    /// than fail or open.
    fn close_run_at(&mut self, section: i64, sections: &Sections, tell: &mut dyn FnMut(LiveMessage)) {
        // An open section may still get samples, so it may still join the missed stretch.
        let other = |section: &Section| !section.is_flagged() && section.verdict != Verdict::Open;
        let ends = sections.get(section).is_some_and(other);
        let run = self.run.and_then(|(id, _)| sections.runs().get(id));
        if ends && run.is_some_and(|run| sections.runs().is_beyond(run, section)) {
            self.close_run(sections, tell);
        }
    }

    fn close_run(&mut self, sections: &Sections, tell: &mut dyn FnMut(LiveMessage)) {
        let Some((id, _)) = self.run.take() else { return };
        let Some(run) = sections.runs().get(id) else { return };
        let (from_m, to_m) = bounds_m(run, sections);
        let failed_m = f64::from(run.failed) * sections.section_m();
        tell(LiveMessage::FlagEnds { run: id.0, from_m, to_m, failed_m });
    }

    fn run(&mut self, id: RunId, change: RunChange, dive: &Loop, tell: &mut dyn FnMut(LiveMessage)) {
        let sections = &dive.view().coverage().sections;
        let Some(run) = sections.runs().get(id) else { return };
        match change {
            // A missed stretch within a reported stretch is not a new stretch.
            RunChange::Raised if self.missed.iter().any(|reported| reported.meets(run)) => {}
            RunChange::Raised => {
                self.close_run(sections, tell);
                let Some(evidence) = sections.evidence_of(run, run.cause) else { return };
                self.run = Some((id, evidence.causes));
                self.missed.push(ReportedMiss { run: id, from: run.from, to: run.to });
                tell(flag(id, run, run.from, &evidence, dive));
            }
            RunChange::Changed => {
                self.widen(run);
                self.tell_other_cause(id, run, dive, tell);
            }
            RunChange::Cleared => self.clear(run, sections, tell),
            RunChange::Merged => {
                if let (Some((last, _)), Some(kept)) = (self.run.as_mut(), run.merged_into)
                    && *last == id
                {
                    *last = kept;
                }
            }
        }
    }

    /// Merges a missed stretch, which has grown, with the reported stretches that it touches.
    fn widen(&mut self, run: &Run) {
        let mut met = self.missed.iter().filter(|reported| reported.meets(run));
        let Some(mut whole) = met.next().copied() else { return };
        (whole.from, whole.to) = (whole.from.min(run.from), whole.to.max(run.to));
        for other in met {
            (whole.from, whole.to) = (whole.from.min(other.from), whole.to.max(other.to));
        }
        self.missed.retain(|reported| !reported.meets(run));
        self.missed.push(whole);
    }

    /// Reports that a missed stretch is cleared, with the bounds reported before. Then reports its parts
    /// without a verdict.
    fn clear(&mut self, run: &Run, sections: &Sections, tell: &mut dyn FnMut(LiveMessage)) {
        let Some(at) = self.missed.iter().position(|reported| reported.meets(run)) else { return };
        let Some(reported) = self.missed.get(at).copied() else { return };
        if sections.runs().all().iter().any(|other| other.is_open() && reported.meets(other)) {
            return;
        }
        self.missed.swap_remove(at);
        let (from_m, to_m) = (sections.bounds_m(reported.from).0, sections.bounds_m(reported.to).0);
        tell(LiveMessage::Cleared { run: reported.run.0, from_m, to_m });
        for section in reported.from..reported.to {
            self.note_unsure(section, sections, tell);
        }
        self.close_unsure(sections, tell);
    }

    /// Reports a missed stretch again if at least a metre of it fails for a cause not reported yet.
    ///
    /// A pilot who follows only the earlier advice may miss the same wall again.
    fn tell_other_cause(&mut self, id: RunId, run: &Run, dive: &Loop, tell: &mut dyn FnMut(LiveMessage)) {
        let sections = &dive.view().coverage().sections;
        let Some((_, reported)) = self.run.as_mut().filter(|(last, _)| *last == id) else { return };
        let lasts = |cause: &Cause| f64::from(run.count(*cause)) * sections.section_m() >= LASTS_M;
        let Some(cause) = Cause::ALL.into_iter().find(|cause| !reported.has(*cause) && lasts(cause)) else {
            return;
        };
        let has = |index: i64| {
            let evidence = sections.get(index).filter(|section| section.is_flagged())?.evidence?;
            evidence.causes.has(cause).then_some((index, evidence))
        };
        let Some((index, evidence)) = (run.from..run.to).find_map(has) else { return };
        *reported = reported.union(evidence.causes);
        tell(flag(id, run, index, &evidence, dive));
    }
}

fn alert_change(change: AlertChange, alert: &ListedAlert, at: MonoNs, dive: &Loop) -> LiveMessage {
    LiveMessage::AlertChange { change, alert: Box::new(alert.json(&dive.view().surroundings(), at)) }
}

/// Returns a reported stretch without a verdict, with the present state of its sections. The ends stay as
/// they were reported.
///
/// If every section has a verdict by now, returns the stretch as it was reported.
fn as_it_is(reported: &Stretch, sections: &Sections) -> Stretch {
    let each = (reported.from..reported.to).filter_map(|index| sections.unsure(index));
    let mut each = each.filter(|here| here.why == reported.why);
    let Some(mut now) = each.next() else { return *reported };
    (now.from, now.to) = (reported.from, reported.to);
    for here in each {
        // The bounds already include all sections, so joining them succeeds.
        if !now.join(&here, sections.section_m()) {
            break;
        }
    }
    now
}

/// Message that reports a missed stretch, from one of its sections on.
fn flag(id: RunId, run: &Run, section: i64, evidence: &Evidence, dive: &Loop) -> LiveMessage {
    let sections = &dive.view().coverage().sections;
    let from_m = sections.bounds_m(section).0;
    let hole = sections.get(section).and_then(|section| section.hole).unwrap_or(run.worst.1);
    let missed = Missed {
        start_m: from_m,
        back_to_m: sections.back_to_m(from_m),
        figures: evidence.into(),
        hole_arc_m: hole.arc_m,
        target_m: sections.target().max_hole_m,
        v_max_mps: dive.view().live_state().v_max_mps().unwrap_or(0.0),
    };
    LiveMessage::Flag { run: id.0, from_m, cause: evidence.cause, causes: evidence.causes, missed }
}

fn bounds_m(run: &Run, sections: &Sections) -> (f64, f64) {
    (sections.bounds_m(run.from).0, sections.bounds_m(run.to - 1).1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn playback_pause_keeps_reported_stretches_and_playback_jump_drops_them() {
        let missed = ReportedMiss { run: RunId(1), from: 0, to: 4 };
        let mut messages =
            LiveMessages { missed: vec![missed], played: Some(MonoNs(5)), ..LiveMessages::default() };
        messages.stopped(MonoNs(5));
        assert_eq!(messages.missed.len(), 1);
        messages.stopped(MonoNs(4));
        assert!(messages.missed.is_empty());
    }
}
