//! Tables 3 to 5 of Jorge et al. 2021: simulated runs compared with the paper's runs, and the Wilcoxon tests of §8.1.

use crate::paper::{Measured, PaperError, Printed, Spacings, Tables, measured, tables};
use headrace_sampling::layout::HeadLayout;
use serde::Serialize;

use crate::runs::{SPEED_MPS, Setting};
use crate::spacing::{Spacing, spacing};
use crate::wilcoxon::{self, Options};
use crate::{ExperimentError, Progress};

/// Tolerance of the distance T_x between passes, relative to the paper's experiment.
const T_X_SHARE: f64 = 0.02;
/// Tolerance of the mean ping distance T_y and of the mean T, relative to the paper's experiment.
const MEAN_SHARE: f64 = 0.03;
/// Length of each simulated run, m, as in the paper.
const LENGTH_M: f64 = 130.0;
/// Effects of the paper's simulator: a sonar with 1 cm of range noise, and a pilot who drifts.
const EFFECTS: &str = "range_noise = { sd_m = 0.01, sensors = [SONARS] }\n\
                       pilot_drift = { across_m = 0.5, up_m = 0.5, yaw_deg = 5 }\n";

/// A run in Table 3 or 4, with its combined distance T from Table 5.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RunRow {
    /// Name of the heads' mode.
    pub mode: &'static str,
    /// Number of heads.
    pub heads: u8,
    /// Whether the heads are in the sector-offset layout instead of the phase-shift layout.
    pub sectors: bool,
    /// Distance T_x between passes, m.
    pub t_x: Pair,
    /// Distance T_y between pings, m: mean, standard deviation, least, largest.
    pub t_y: [Pair; 4],
    /// Combined distance T, m: mean, least, largest; `None` for one head, which Table 5 leaves out.
    pub t: Option<[Pair; 3]>,
    /// The speed that gives the paper's distance T_x between passes, m/s.
    pub paper_speed_mps: f64,
    /// The quantities that miss their targets (distances T_x, mean T_y, mean T), with reasons.
    pub misses: Vec<String>,
}

/// A number from the paper beside the recomputed number.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Pair {
    /// Number printed in the paper.
    pub paper: f64,
    /// Recomputed number.
    pub ours: f64,
}

impl Pair {
    fn new(paper: Printed, ours: f64) -> Self {
        Self { paper: paper.value(), ours }
    }

    /// Relative difference of the two numbers, positive if the recomputed one is larger.
    pub fn difference(&self) -> f64 {
        self.ours / self.paper - 1.0
    }

    fn within(&self, share: f64) -> bool {
        self.difference().abs() <= share
    }
}

/// A Wilcoxon signed-rank test over the runs with several heads.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SignedRankRow {
    /// The compared quantity.
    pub what: &'static str,
    /// Whether the test is for the sector-offset layout instead of the phase-shift layout.
    pub sectors: bool,
    /// Two-sided p value of the test of the predictions against the paper's experiments; `None` if all differences are
    /// zero.
    pub p_paper: Option<f64>,
    /// Two-sided p value of the test of the predictions against the experiments simulated here.
    pub p_ours: Option<f64>,
}

/// Simulates all runs of Tables 3 and 4.
///
/// Errors: none with the built-in vehicles.
pub(crate) fn runs(progress: Progress<'_>) -> Result<Vec<RunRow>, ExperimentError> {
    let mut rows = Vec::new();
    for run in measured()? {
        let layouts =
            [(HeadLayout::PhaseShift, Some(run.phase_shift)), (HeadLayout::SectorOffset, run.sector_offset)];
        for (layout, paper) in layouts {
            let Some(paper) = paper else { continue };
            progress(&format!("{} with {} heads", run.mode, run.heads));
            let setting = setting(&run, layout);
            let dive = setting.dive()?;
            let turn_s = dive.ping_period_s * headrace_geometry::math::TAU / dive.step_rad;
            rows.push(row(&run, layout, &paper, &spacing(&dive, layout), turn_s));
        }
    }
    Ok(rows)
}

fn setting(run: &Measured, layout: HeadLayout) -> Setting {
    Setting {
        heads: run.heads,
        mode: run.mode,
        layout,
        aligned: true,
        occlusion: false,
        length_m: LENGTH_M,
        effects: EFFECTS.to_owned(),
        seed: 1,
    }
}

fn row(run: &Measured, layout: HeadLayout, paper: &Spacings, ours: &Spacing, turn_s: f64) -> RunRow {
    let sectors = layout == HeadLayout::SectorOffset;
    let [mean, sd, min, max] = paper.t_y_m;
    let t_x = Pair::new(paper.t_x_m, ours.t_x_m);
    let t_y = [
        Pair::new(mean, ours.t_y.mean_m),
        Pair::new(sd, ours.t_y.sd_m),
        Pair::new(min, ours.t_y.min_m),
        Pair::new(max, ours.t_y.max_m),
    ];
    let t = paper.t_m.map(|[mean, min, max]| {
        let [a, b, c] = ours.t_m;
        [Pair::new(mean, a), Pair::new(min, b), Pair::new(max, c)]
    });
    let share = if sectors { 2.0 } else { 1.0 } / f64::from(run.heads);
    let paper_speed_mps = t_x.paper / (turn_s * share);
    let mut row = RunRow {
        mode: run.mode,
        heads: run.heads,
        sectors,
        t_x,
        t_y,
        t,
        paper_speed_mps,
        misses: Vec::new(),
    };
    row.misses = misses(&row, turn_s * share);
    row
}

/// The quantities (distances T_x, mean T_y, mean T) that miss their targets, with reasons.
fn misses(row: &RunRow, seconds: f64) -> Vec<String> {
    let mut misses = Vec::new();
    let percent = |pair: &Pair| 100.0 * pair.difference();
    if !row.t_x.within(T_X_SHARE) {
        misses.push(format!(
            "T_x by {:+.1} %: the paper's is that of {:.3} m/s, {:+.1} % of the {SPEED_MPS} m/s it states ({seconds:.2} s \
             between passes)",
            percent(&row.t_x),
            row.paper_speed_mps,
            100.0 * (row.paper_speed_mps / SPEED_MPS - 1.0),
        ));
    }
    let [mean, ..] = &row.t_y;
    if !mean.within(MEAN_SHARE) {
        misses.push(format!(
            "mean T_y by {:+.1} %, {:+.1} mm; the paper prints whole millimetres",
            percent(mean),
            1e3 * (mean.ours - mean.paper),
        ));
    }
    if let Some([mean, ..]) = row.t.as_ref().filter(|[mean, ..]| !mean.within(MEAN_SHARE)) {
        misses.push(format!("mean T by {:+.1} %, as T_x does", percent(mean)));
    }
    misses
}

/// The Wilcoxon tests of Jorge et al. 2021, §8.1: predictions against experiments, over all modes and two to four
/// heads.
///
/// Errors: none with the built-in numbers.
pub(crate) fn signed_ranks(rows: &[RunRow]) -> Result<Vec<SignedRankRow>, PaperError> {
    let predicted = tables()?;
    let mut tests = Vec::new();
    for sectors in [false, true] {
        for (what, column) in COLUMNS {
            let (mut baseline, mut paper, mut ours) = (Vec::new(), Vec::new(), Vec::new());
            for row in rows.iter().filter(|row| row.heads > 1 && row.sectors == sectors) {
                let Some(value) = column.predicted(&predicted, row) else { continue };
                let pair = column.measured(row);
                baseline.push(value);
                paper.push(pair.paper);
                ours.push(pair.ours);
            }
            let p = |other: &[f64]| {
                wilcoxon::of_pairs(&baseline, other, Options::default()).ok().map(|test| test.p_two_sided)
            };
            tests.push(SignedRankRow { what, sectors, p_paper: p(&paper), p_ours: p(&ours) });
        }
    }
    Ok(tests)
}

#[derive(Debug, Clone, Copy)]
enum Column {
    TX,
    Mean,
    Min,
    Max,
}

const COLUMNS: [(&str, Column); 4] =
    [("T_x", Column::TX), ("mean T_y", Column::Mean), ("T_ymin", Column::Min), ("T_ymax", Column::Max)];

impl Column {
    fn measured(self, row: &RunRow) -> Pair {
        let [mean, _, min, max] = row.t_y;
        match self {
            Self::TX => row.t_x,
            Self::Mean => mean,
            Self::Min => min,
            Self::Max => max,
        }
    }

    fn predicted(self, tables: &Tables, row: &RunRow) -> Option<f64> {
        let mut predictions = tables.table_4.rows.iter();
        let found = predictions.find(|known| known.mode == row.mode && known.heads == row.heads)?;
        Some(match self {
            Self::TX if row.sectors => found.sector_t_x_m.at_stated_speed.ours,
            Self::TX => found.phase_t_x_m.at_stated_speed.ours,
            Self::Mean => found.t_y_mean_m.ours,
            Self::Min => found.t_y_min_m.ours,
            Self::Max => found.t_y_max_m.ours,
        })
    }
}
