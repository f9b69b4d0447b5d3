//! All experiments of Jorge et al. 2021, and whether the simulated runs confirm the paper's findings.

use serde::Serialize;

use crate::compared::{self, RunRow, SignedRankRow};
use crate::hidden::{self, HiddenRow};
use crate::meshes::{self, MeshRow};
use crate::runs::SPEED_MPS;
use crate::stationary::{self, Perimeter};
use crate::{ExperimentError, Progress};

/// Recomputed results beside the paper's results.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Experiments {
    /// Speed of the runs, m/s.
    pub speed_mps: f64,
    /// The runs of Tables 3 to 5.
    pub runs: Vec<RunRow>,
    /// Signed-rank tests (§8.1).
    pub signed_ranks: Vec<SignedRankRow>,
    /// Surfaces and their distance from the wall (§8.2, §8.3).
    pub meshes: Vec<MeshRow>,
    /// Occlusion between heads (§8.3).
    pub hidden: Vec<HiddenRow>,
    /// Perimeter from a stationary turn (§9.2).
    pub perimeter: Perimeter,
    /// The paper's findings, and whether they are confirmed.
    pub findings: Vec<Finding>,
}

/// A finding of the paper.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Finding {
    /// The paper's statement.
    pub says: &'static str,
    /// Whether the simulated runs confirm the paper's statement.
    pub holds: bool,
    /// The simulated result.
    pub evidence: String,
}

/// Runs all experiments; `progress` receives status messages.
///
/// Errors: none with the built-in vehicles.
pub fn run(progress: Progress<'_>) -> Result<Experiments, ExperimentError> {
    let runs = compared::runs(progress)?;
    let signed_ranks = compared::signed_ranks(&runs)?;
    let meshes = meshes::rows(progress)?;
    let hidden = hidden::rows(progress)?;
    progress("the perimeter from a stationary turn");
    let perimeter = stationary::perimeter()?;
    let findings = findings(&meshes, &hidden);
    Ok(Experiments { speed_mps: SPEED_MPS, runs, signed_ranks, meshes, hidden, perimeter, findings })
}

fn findings(meshes: &[MeshRow], hidden: &[HiddenRow]) -> Vec<Finding> {
    let mean = |heads: u8, sectors: bool, aligned: bool| {
        let mut rows = meshes.iter();
        rows.find(|row| (row.heads, row.sectors, row.aligned) == (heads, sectors, aligned))
            .map_or(f64::NAN, |row| row.poisson_m[0])
    };
    let mm = |m: f64| format!("{:.1} mm", 1e3 * m);
    let change = |sectors| mean(2, sectors, false) / mean(2, sectors, true);
    let mut findings = vec![
        Finding {
            says: "alignment matters to phase shift",
            holds: change(false) > 1.1,
            evidence: format!(
                "two heads, SLOW: {} aligned, {} unaligned ({:+.0} %)",
                mm(mean(2, false, true)),
                mm(mean(2, false, false)),
                100.0 * (change(false) - 1.0)
            ),
        },
        Finding {
            says: "alignment doesn't matter to sector offset",
            holds: (change(true) - 1.0).abs() < (change(false) - 1.0).abs() / 2.0,
            evidence: format!(
                "two heads, SLOW: {} aligned, {} unaligned ({:+.0} %)",
                mm(mean(2, true, true)),
                mm(mean(2, true, false)),
                100.0 * (change(true) - 1.0)
            ),
        },
    ];
    for (heads, says) in [
        (2, "two heads: aligned phase shift beats sectors"),
        (3, "three heads: aligned phase shift beats sectors"),
        (4, "four heads: aligned phase shift beats sectors"),
    ] {
        let (phase, sector) = (mean(heads, false, true), mean(heads, true, true));
        let evidence = format!("{} against {}", mm(phase), mm(sector));
        findings.push(Finding { says, holds: phase < sector, evidence });
    }
    findings.extend(hidden.iter().map(of_hidden));
    findings
}

/// Finding of §8.3: the distance between passes where neighbouring heads occlude the wall.
fn of_hidden(row: &HiddenRow) -> Finding {
    let twice = (1.9..2.15).contains(&row.times_in_shadow);
    let (says, holds) = match (row.heads, row.side_by_side_deg > 135.0) {
        (3, _) => ("three heads: hidden places have twice T_x / s", twice),
        (_, true) => ("four heads, neighbours half a turn apart: hidden places have twice T_x / s", twice),
        (_, false) => {
            ("four heads, neighbours a quarter turn apart: up to four times T_x / s", row.times > 3.5)
        }
    };
    let evidence = format!(
        "neighbours {:.0} deg apart: {:.2} times in the shadow, {:.2} at most; {:.2} deg, {:.2} m of wall hidden",
        row.side_by_side_deg, row.times_in_shadow, row.times, row.angle_deg, row.gap_m
    );
    Finding { says, holds, evidence }
}
