//! Goals for the figures of a cell of the field table.

use headrace_tests::field_table::{Cell, Condition, Driven, Figures, KINDS_OF_SOURCES};

/// Bounds of a cell's figures. The first is the largest share of false fails among the sections with a true hole below
/// 0.9 times the target. The second is the largest undecided share of the length. The third is the smallest passed
/// share of the passable length.
struct Bounds {
    false_fails: f64,
    cannot_say: f64,
    passed: f64,
    /// Smallest ratio of the advised speed to the largest speed that the paper's Eq. 16 gives with the vehicle's own
    /// occlusion.
    advice: f64,
}

/// Goals that a cell of the field table misses.
#[derive(Debug, Clone, Copy, Default)]
#[expect(clippy::struct_excessive_bools, reason = "one for each goal")]
pub(crate) struct Missed {
    pub(crate) passed_over: bool,
    pub(crate) passed_far: bool,
    pub(crate) failed_under: bool,
    pub(crate) cannot_say: bool,
    pub(crate) passed: bool,
    pub(crate) advice: bool,
    pub(crate) ratio: bool,
    pub(crate) within: bool,
    pub(crate) nis: [bool; KINDS_OF_SOURCES.len()],
    pub(crate) unreported: bool,
}

impl Missed {
    pub(crate) fn of(cell: &Cell, figures: &Figures) -> Self {
        let bounds = match cell.condition {
            Condition::Clean | Condition::DataSheet | Condition::Declared => {
                Some(Bounds { false_fails: 0.0, cannot_say: 0.02, passed: 0.97, advice: 0.95 })
            }
            Condition::Poor
            | Condition::Murk
            | Condition::Fish
            | Condition::Rough
            | Condition::AsBuilt
            | Condition::Altered
            | Condition::Lively => {
                Some(Bounds { false_fails: 0.005, cannot_say: 0.08, passed: 0.88, advice: 0.8 })
            }
            _ => None,
        };
        let first_go =
            matches!(cell.driven, Driven::Planned | Driven::Stood | Driven::Swung | Driven::Advised);
        let ratios = if bounds.is_some() { 0.7..=1.3 } else { 0.0..=1.5 };
        // The holes D and D_true are comparable only if there was a single visit. After several visits, D is that of
        // the best visit, but D_true combines all visits. In the `Lively` condition, the pilot also goes back.
        let once = match cell.driven {
            Driven::Back => false,
            Driven::Planned | Driven::Stood | Driven::Swung | Driven::Times(_) => {
                cell.condition != Condition::Lively
            }
            Driven::Advised => true,
        };
        let judged = !figures.errors.is_empty() && once;
        let nis = |kind| bounds.is_some() && figures.nis(kind).is_some_and(|nis| !(0.7..=1.4).contains(&nis));
        Self {
            passed_over: figures.false_passes() > 0.025,
            passed_far: figures.passed_far > 0,
            failed_under: bounds.as_ref().is_some_and(|bounds| figures.false_fails() > bounds.false_fails),
            cannot_say: bounds
                .as_ref()
                .is_some_and(|bounds| first_go && figures.share(2) > bounds.cannot_say),
            passed: bounds
                .as_ref()
                .is_some_and(|bounds| first_go && figures.share(0) < bounds.passed * figures.passable()),
            advice: bounds
                .as_ref()
                .is_some_and(|bounds| first_go && advice_share(cell, figures) < bounds.advice),
            ratio: judged && !ratios.contains(&figures.ratio_rms()),
            within: judged && bounds.is_some() && !(0.93..=0.98).contains(&figures.within(2.0)),
            nis: core::array::from_fn(nis),
            unreported: figures.way_m[1] < figures.way_m[0] - 1e-6,
        }
    }

    /// Names of the missed goals, equal to the table's column names.
    pub(crate) fn names(&self) -> Vec<String> {
        let single = [
            ("passed", self.passed_over),
            ("far", self.passed_far),
            ("failed_under", self.failed_under),
            ("cannot_say", self.cannot_say),
            ("pass", self.passed),
            ("advice", self.advice),
            ("ratio", self.ratio),
            ("within", self.within),
            ("told_m", self.unreported),
        ];
        let named = single.iter().filter(|(_, missed)| *missed).map(|(name, _)| (*name).to_owned());
        let nis = KINDS_OF_SOURCES.iter().zip(&self.nis).filter(|(_, missed)| **missed);
        named.chain(nis.map(|((name, _), _)| format!("nis_{}", name.replace(' ', "_")))).collect()
    }
}

/// Ratio of the median advised speed to the largest speed that the paper's Eq. 16 gives.
pub(crate) fn advice_share(cell: &Cell, figures: &Figures) -> f64 {
    figures.advised_mps() / cell.vehicle.edge_mps
}
