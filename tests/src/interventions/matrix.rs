//! Confusion matrix of displayed and true causes.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use headrace_coverage::Cause;

use super::judging::{InterventionDive, Right};

/// Number of the program's answers, and how many of them are right.
#[derive(Debug, Default, Clone, Copy)]
pub struct Count {
    /// Number of all answers.
    pub all: u32,
    /// Number of right answers.
    pub right: u32,
}

impl Count {
    pub(super) fn add(&mut self, right: bool) {
        self.all += 1;
        self.right += u32::from(right);
    }

    /// Returns the sum of both counts.
    #[must_use]
    pub(super) fn and(self, other: Self) -> Self {
        Self { all: self.all + other.all, right: self.right + other.right }
    }

    /// The count as text, such as "3 of 4 (75.0 %)".
    pub fn text(self) -> String {
        format!("{} of {} ({:.1} %)", self.right, self.all, 100.0 * self.share())
    }

    /// Fraction of right answers, 0 to 1; 1 without answers.
    pub fn share(self) -> f64 {
        if self.all == 0 { 1.0 } else { f64::from(self.right) / f64::from(self.all) }
    }
}

/// Comparison of displayed with true causes by section and by stretch, for dives with one cause and with two.
#[derive(Debug, Default)]
pub struct Matrix {
    /// Answers for sections; the index is the number of injected causes minus one.
    pub sections: [Count; 2],
    /// Answers for stretches; the index is the number of injected causes minus one.
    pub stretches: [Count; 2],
    /// Answers for stretches that truly have two causes.
    pub pairs: Count,
    /// As `pairs`, but an answer that is nearly right also counts as right: see [`super::Judged::is_close`].
    pub close_pairs: Count,
    /// Answers for stretches. An answer is right if the program displays the whole stretch as one missed stretch
    /// (`run`), or displays none of it as missed.
    pub one_run: Count,
    /// Number of dives without a failed section.
    pub idle: u32,
    /// Number of sections and number of stretches for each pair of true and displayed cause, in dives with one cause.
    reported: BTreeMap<(String, String), [u32; 2]>,
    /// Number of stretches with a wrong answer for each pair of true and displayed causes, in dives with two causes.
    wrong: BTreeMap<(String, String), u32>,
}

fn words(causes: &[Cause]) -> String {
    causes.iter().map(|cause| cause.as_str()).collect::<Vec<_>>().join("+")
}

fn any_words(right: &Right) -> String {
    right.iter().map(|set| words(set)).collect::<Vec<_>>().join(" or ")
}

impl Matrix {
    /// Adds the answers for a dive.
    pub fn add(&mut self, dive: &InterventionDive) {
        let several = dive.drawn.injected.len() - 1;
        self.idle += u32::from(dive.sections.is_empty());
        for section in &dive.sections {
            self.sections[several].add(section.is_right());
            self.note(several, &section.right, &section.reported, 0);
        }
        for stretch in dive.stretches() {
            let is_right = stretch.right.iter().any(|set| set == stretch.reported());
            self.stretches[several].add(is_right);
            self.one_run.add(stretch.runs() <= 1);
            if stretch.right.iter().all(|set| set.len() > 1) {
                self.pairs.add(is_right);
                let close = stretch.sections.iter().filter(|section| section.reported == stretch.reported());
                let mut close = close.peekable();
                let is_close = close.peek().is_some()
                    && close.all(|section| section.is_close(&dive.drawn.injected, dive.drawn.target_m));
                self.close_pairs.add(is_right || is_close);
            }
            self.note(several, &stretch.right, stretch.reported(), 1);
        }
    }

    fn note(&mut self, several: usize, right: &Right, reported: &[Cause], which: usize) {
        let key = (any_words(right), words(reported));
        if several == 0 {
            self.reported.entry(key).or_default()[which] += 1;
        } else if which == 1 && !right.iter().any(|set| set == reported) {
            *self.wrong.entry(key).or_default() += 1;
        }
    }

    /// The confusion matrix as text.
    pub fn text(&self) -> String {
        let mut text =
            String::from("one cause injected: true cause, then displayed causes with sections/stretches\n");
        let mut last = "";
        for ((right, reported), [sections, stretches]) in &self.reported {
            if right != last {
                write!(text, "{}  {right:<16}", if last.is_empty() { "" } else { "\n" }).unwrap();
                last = right;
            }
            write!(text, " {reported} {sections}/{stretches};").unwrap();
        }
        text.push_str("\ntwo causes injected, wrong stretches: true, displayed, number\n");
        for ((right, reported), stretches) in &self.wrong {
            writeln!(text, "  {right:<45} {reported:<35} {stretches}").unwrap();
        }
        for (what, count) in [
            ("sections, one cause", self.sections[0]),
            ("stretches, one cause", self.stretches[0]),
            ("sections, two causes", self.sections[1]),
            ("stretches, two causes", self.stretches[1]),
            ("of these, stretches with a true set of two causes", self.pairs),
            (
                "the same, or a displayed cause whose removal brings holes within 1.05 of the target",
                self.close_pairs,
            ),
            ("stretches of at most one run", self.one_run),
        ] {
            writeln!(text, "{what}: {}", count.text()).unwrap();
        }
        writeln!(text, "dives without a failed section: {}", self.idle).unwrap();
        text
    }
}
