//! Coverage judgements for viewers: verdicts of sections, missed stretches, and alerts to the pilot.

use std::collections::BTreeMap;

use headrace_coverage::{Cause, Judgement, RunChange, Verdict, back_to_m};
use headrace_geometry::time::{DurNs, MonoNs};
use headrace_monitor::pilot_text::{Missed as MissedText, cause_text, cleared_text, flag_text};
use headrace_monitor::section_judgement::SectionJudgement;

use super::messages::{Level, Log, Missed, Section, Stretch, rounded};
use super::site::Site;

/// Minimum interval between two published lists of missed stretches.
const EVERY: DurNs = DurNs(2_000_000_000);
/// Maximum number of stretches in a list. The stretches farthest from the portal are kept.
///
/// The limit keeps the log small even if a dive misses everything.
const MOST_STRETCHES: usize = 40;

/// Judgements of all sections so far.
#[derive(Debug, Default)]
pub(super) struct Sections {
    /// Flagged sections by number, each with its cause of failure and the diameter of its hole, m.
    flagged: BTreeMap<i64, (Cause, f64)>,
    /// First and last section of each missed stretch, by the stretch's number.
    runs: BTreeMap<u64, (i64, i64)>,
    /// Numbers of the missed stretches that have changed, each with its change.
    ///
    /// The next judgement is that of the section that caused the change, and it creates the alert to the pilot.
    changed_runs: Vec<(u64, u64)>,
    shown: Option<MonoNs>,
    changed: bool,
}

impl Sections {
    /// Stores the change of a missed stretch, for use at the next judgement of a section.
    pub(super) fn run(&mut self, id: u64, change: u64) {
        self.changed_runs.push((id, change));
    }

    /// Processes the judgement of a section. Returns the section for display, and the alerts to the pilot.
    ///
    /// `v_max_mps` is the advised speed.
    pub(super) fn judge(
        &mut self,
        judged: &SectionJudgement,
        site: &Site,
        v_max_mps: f64,
    ) -> (Section, Vec<Log>) {
        let index = judged.index;
        let flagged = match judged.change {
            Judgement::Raised => true,
            Judgement::Cleared => false,
            Judgement::Updated => self.flagged.contains_key(&index),
        };
        let before = self.flagged.get(&index).copied();
        let now = judged.cause.filter(|_| flagged).map(|figures| (figures.cause(), judged.hole_m));
        match now {
            Some(now) => self.flagged.insert(index, now),
            None => self.flagged.remove(&index),
        };
        self.changed |= before != now;
        let said = core::mem::take(&mut self.changed_runs);
        let said = said.into_iter().filter_map(|(id, change)| self.say(id, change, judged, site, v_max_mps));
        let said = said.collect();
        (shown(judged, flagged, site), said)
    }

    /// Creates the alert to the pilot about a missed stretch that has changed.
    fn say(
        &mut self,
        id: u64,
        change: u64,
        judged: &SectionJudgement,
        site: &Site,
        v_max_mps: f64,
    ) -> Option<Log> {
        let index = judged.index;
        let span = self.runs.entry(id).or_insert((index, index));
        if change == RunChange::Cleared as u64 {
            let (from, to) = self.runs.remove(&id)?;
            // Some sections of the cleared stretch may still be flagged, because they now belong to another missed
            // stretch.
            let open = self.flagged.range(from..=to).next().is_some();
            let words = cleared_text(from as f64 * site.section_m, (to + 1) as f64 * site.section_m);
            return (!open).then(|| Log::new(judged.at, Level::Info, words));
        }
        *span = (span.0.min(index), span.1.max(index));
        let figures = judged.cause.filter(|_| judged.verdict == Verdict::Fail)?;
        (change == RunChange::Raised as u64).then(|| {
            let missed = MissedText {
                start_m: index as f64 * site.section_m,
                back_to_m: back_to_m(index as f64 * site.section_m, site.run_up_m),
                figures,
                hole_arc_m: judged.hole_arc_m,
                target_m: site.target_m,
                v_max_mps,
            };
            Log::new(judged.at, Level::Warning, flag_text(&missed, &site.profile, &site.head_descriptions))
        })
    }

    /// Makes the next list of missed stretches due at once.
    pub(super) fn hurry(&mut self) {
        self.shown = None;
    }

    /// Returns the list of missed stretches, if it has changed and is due.
    pub(super) fn show(&mut self, at: MonoNs, site: &Site) -> Option<Missed> {
        let waits = self.shown.is_some_and(|shown| (0..EVERY.0).contains(&at.since(shown).0));
        (self.changed && !waits).then(|| {
            (self.shown, self.changed) = (Some(at), false);
            let missed_m = rounded(self.flagged.len() as f64 * site.section_m, 1e3);
            Missed { timestamp: at.into(), missed_m, stretches: self.stretches(site) }
        })
    }

    /// Returns the list for display. Adjacent flagged sections with the same cause form one stretch.
    fn stretches(&self, site: &Site) -> Vec<Stretch> {
        let mut stretches: Vec<Stretch> = Vec::new();
        let mut last = None;
        for (index, (cause, hole_m)) in self.flagged.iter().rev() {
            let (from_m, to_m) = bounds_m(*index, site);
            let hole_m = rounded(*hole_m, 1e3);
            let goes_on = last == Some((*index + 1, *cause));
            last = Some((*index, *cause));
            if let Some(stretch) = stretches.last_mut().filter(|_| goes_on) {
                stretch.from_m = from_m;
                stretch.hole_m = stretch.hole_m.max(hole_m);
            } else if stretches.len() < MOST_STRETCHES {
                stretches.push(Stretch { from_m, to_m, hole_m, cause: cause.as_str() });
            } else {
                break;
            }
        }
        stretches.reverse();
        stretches
    }
}

fn bounds_m(index: i64, site: &Site) -> (f64, f64) {
    let end = |index: i64| rounded(index as f64 * site.section_m, 1e4);
    (end(index), end(index + 1))
}

fn shown(judged: &SectionJudgement, flagged: bool, site: &Site) -> Section {
    let (start_m, end_m) = bounds_m(judged.index, site);
    let cause = judged.cause.filter(|_| flagged || judged.verdict == Verdict::Fail);
    Section {
        timestamp: judged.at.into(),
        start_m,
        end_m,
        verdict: judged.verdict.as_str(),
        hole_m: rounded(judged.hole_m, 1e3),
        hole_sd_m: rounded(judged.hole_sd_m, 1e3),
        hole_x_m: rounded(judged.hole_x_m, 1e2),
        hole_clock: site.profile.clock(judged.hole_arc_m),
        target_m: site.target_m,
        flagged,
        cause: cause.map_or("", |figures| figures.cause().as_str()),
        words: cause.as_ref().map(|figures| cause_text(figures, &site.head_descriptions)).unwrap_or_default(),
    }
}
