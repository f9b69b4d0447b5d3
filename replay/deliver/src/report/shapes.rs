//! Sections, profile, map, mesh and findings of a dive, as plain values for the files of other programs.

use headrace_coverage::{Unsure, Verdict};
use headrace_geometry::math;
use headrace_geometry::tunnel::Yz;
use headrace_monitor::pilot_text::station;
use headrace_monitor::report::RunReport;
use headrace_monitor::section_row::SectionRow;
use headrace_monitor::words::NOT_INSPECTED;

use super::chapters::Delivery;
use super::figures::{row_at, section_word, word};
use super::measured::{places_m, usual_step_m};
use super::tables::{causes, reason};
use super::wall::{SECTORS, Wall};
use crate::files::data::{Edges, Finding, ProfileStation, Section, WallMap, WallMesh};

/// Clock sectors at the floor, left wall, crown and right wall, and number of sectors that are averaged at each.
const FLOOR: usize = 0;
const LEFT: usize = SECTORS / 4;
const CROWN: usize = SECTORS / 2;
const RIGHT: usize = SECTORS * 3 / 4;
const EDGE_SECTORS: usize = 4;
/// Largest number of cross-sections. The report has a page for each dozen.
const MOST_SECTIONS: f64 = 2000.0;
/// Largest number of pixels of a map along the tunnel. Some viewers have a limit of 32,767.
const MOST_COLUMNS: usize = 30_000;
/// Largest number of rings of the mesh, and of one of its parts.
const MOST_RINGS: usize = 10_000;
const PART_RINGS: usize = 500;

impl Delivery<'_> {
    /// Cross-sections at the same chainages as in the report.
    pub fn sections(&self) -> Vec<Section> {
        let extent = self.report.coverage_extent;
        let (Some(from_m), Some(to_m)) = (extent.from_m, extent.to_m) else { return Vec::new() };
        let every_m = self.every_m.unwrap_or_else(|| usual_step_m(to_m - from_m));
        places_m([from_m, to_m], every_m).into_iter().map(|x_m| self.section(x_m)).collect()
    }

    /// Least distance between cross-sections, m: the coverage extent has at most 2,000 of them.
    pub fn least_every_m(&self) -> f64 {
        self.report.coverage_extent.length_m / MOST_SECTIONS
    }

    fn section(&self, x_m: f64) -> Section {
        let outline_m = self.wall.around(x_m, self.report.target_m);
        let corner = |sector: usize| {
            let mean_m = self.wall.cell(outline_m, sector, 1).mean_m();
            mean_m.map(|mean_m| wall_point(self.wall, sector as f64 + 0.5, mean_m))
        };
        let corners: Vec<_> = (0..SECTORS).map(corner).collect();
        let row = row_at(&self.report.sections, x_m);
        Section {
            station: station(x_m),
            chainage_m: x_m,
            measured_m: pieces(&corners),
            design_m: (0..2 * SECTORS).map(|half| wall_point(self.wall, half as f64 / 2.0, 0.0)).collect(),
            verdict: row.map_or(NOT_INSPECTED, section_word).to_owned(),
            hole_m: row.and_then(|row| row.hole_m),
            hole_sd_m: row.filter(|row| row.hole_m.is_some()).map(|row| row.hole_sd_m),
        }
    }

    /// Longitudinal profile, with a station in the middle of each section.
    pub fn profile(&self) -> Vec<ProfileStation> {
        let edges = |off_m: &dyn Fn(usize) -> Option<f64>| {
            let edge = |sector: usize, axis: usize| {
                off_m(sector).map(|off_m| wall_point(self.wall, sector as f64, off_m)[axis])
            };
            let (floor_m, crown_m) = (edge(FLOOR, 1), edge(CROWN, 1));
            Edges { floor_m, crown_m, left_m: edge(LEFT, 0), right_m: edge(RIGHT, 0) }
        };
        let design = edges(&|_| Some(0.0));
        let at = |row: &SectionRow| {
            let mean_m = |sector: usize| {
                let first = sector + SECTORS - EDGE_SECTORS / 2;
                self.wall.cell([row.start_m, row.end_m], first, EDGE_SECTORS).mean_m()
            };
            let chainage_m = f64::midpoint(row.start_m, row.end_m);
            ProfileStation { station: station(chainage_m), chainage_m, measured: edges(&mean_m), design }
        };
        self.report.sections.iter().map(at).collect()
    }

    /// Calls `encode` with the map of the unrolled wall; `None` if the report has no section.
    pub fn map<T>(&self, encode: impl FnOnce(&WallMap) -> T) -> Option<T> {
        let from_m = self.report.sections.first()?.start_m;
        let (columns, step_m) = self.columns(MOST_COLUMNS);
        let perimeter_m = self.wall.profile.perimeter_m();
        let height_m = perimeter_m / SECTORS as f64;
        let sector_of_row: Vec<usize> =
            (0..SECTORS).map(|row| self.wall.sector(perimeter_m - (row as f64 + 0.5) * height_m)).collect();
        let deviation_m = |column: u32, row: u32| {
            let x_m = from_m + f64::from(column) * step_m;
            let sector = *sector_of_row.get(usize::try_from(row).ok()?)?;
            self.wall.cell([x_m, x_m + step_m], sector, 1).mean_m()
        };
        let size = [columns, SECTORS].map(|count| u32::try_from(count).unwrap_or(u32::MAX));
        let (from_m, pixel_m) = ([from_m, 0.0], [step_m, height_m]);
        Some(encode(&WallMap { size, from_m, pixel_m, deviation_m: &deviation_m }))
    }

    /// The wall as triangles, in parts. Triangles of wall that was not measured lie on the design.
    pub fn mesh(&self) -> Vec<WallMesh> {
        let (columns, step_m) = self.columns(MOST_RINGS);
        let from_m = self.report.sections.first().map_or(0.0, |row| row.start_m);
        let part = |begin: usize| {
            let mut part = WallMesh::default();
            // Neighbouring parts share a ring of corners, so that no gap is between them.
            for column in begin..columns.min(begin + PART_RINGS + 1) {
                let x_m = from_m + column as f64 * step_m;
                for sector in 0..SECTORS {
                    let mean_m = self.wall.cell([x_m, x_m + step_m], sector, 1).mean_m();
                    let [y, z] = wall_point(self.wall, sector as f64 + 0.5, mean_m.unwrap_or(0.0));
                    part.corners_m.push([x_m + step_m / 2.0, y, z]);
                    part.deviations_m.push(mean_m);
                }
                part.triangles.extend(band(column - begin));
            }
            part
        };
        (0..columns).step_by(PART_RINGS).map(part).collect()
    }

    /// Number of columns, at most `most`, and length of a column. A column consists of whole sections.
    fn columns(&self, most: usize) -> (usize, f64) {
        let sections = self.report.sections.len();
        let each = sections.div_ceil(most).max(1);
        (sections.div_ceil(each), each as f64 * self.report.section_m)
    }

    /// Findings: missed stretches, stretches without verdict or inspection, and stretches outside the design.
    pub fn findings(&self) -> Vec<Finding> {
        let report = self.report;
        let stated = report.runs.iter().filter(|run| run.merged_into.is_none());
        let mut findings: Vec<_> = stated.map(missed).collect();
        findings.extend(report.no_verdict.iter().map(|stretch| {
            let text = format!("{:.2} m without verdict", stretch.no_verdict_m);
            let is_inspected = stretch.stretch.why != Unsure::NotInspected;
            let kind = if is_inspected { word(Verdict::CannotSay) } else { NOT_INSPECTED };
            Finding { cause: reason(stretch), text, ..finding([stretch.start_m, stretch.end_m], kind) }
        }));
        findings.extend(report.wall_stretches.iter().map(|stretch| {
            let [mean, inmost, outmost] = [stretch.mean_m, stretch.inmost_m, stretch.outmost_m];
            let text =
                format!("deviation {mean:.2} m, from {inmost:.2} to {outmost:.2} m, outwards positive");
            Finding { text, ..finding([stretch.from_m, stretch.to_m], "outside the design") }
        }));
        findings.sort_by(|a, b| a.chainages_m[0].total_cmp(&b.chainages_m[0]));
        findings
    }
}

fn missed(run: &RunReport) -> Finding {
    let kind = if run.cleared_s.is_some() { "missed, then refilled" } else { "missed" };
    let text = format!("largest hole {:.2} m at {}", run.hole_m, run.hole_clock);
    Finding { cause: causes(run), text, ..finding([run.start_m, run.end_m], kind) }
}

fn finding(chainages_m: [f64; 2], kind: &str) -> Finding {
    Finding { stations: chainages_m.map(station), chainages_m, kind: kind.to_owned(), ..Finding::default() }
}

/// Point at a sector, `off_m` outside the design along the ray from the reference point.
fn wall_point(wall: &Wall, sector: f64, off_m: f64) -> Yz {
    let [y, z] = wall.profile.point_at(wall.arc_m(sector) % wall.profile.perimeter_m());
    let reference = wall.profile.reference();
    let ray = [y - reference[0], z - reference[1]];
    let share = off_m / math::hypot(ray[0], ray[1]);
    [y + ray[0] * share, z + ray[1] * share]
}

/// Pieces of an outline around the wall, without its gaps. The outline is closed, so the last corner is next to the
/// first.
fn pieces(corners: &[Option<Yz>]) -> Vec<Vec<Yz>> {
    let mut pieces: Vec<Vec<Yz>> =
        corners.split(Option::is_none).map(|piece| piece.iter().flatten().copied().collect()).collect();
    if pieces.len() > 1 {
        let first = pieces.remove(0);
        pieces.last_mut().into_iter().for_each(|last| last.extend(&first));
    } else if let [ring] = pieces.as_mut_slice() {
        ring.extend(ring.first().copied());
    }
    pieces.retain(|piece| !piece.is_empty());
    pieces
}

/// Triangles between a ring of a part and the previous ring; none for the first ring.
fn band(ring: usize) -> impl Iterator<Item = [u32; 3]> {
    let corner =
        |ring: usize, sector: usize| u32::try_from(SECTORS * ring + sector % SECTORS).unwrap_or(u32::MAX);
    (1..=ring).last().into_iter().flat_map(move |ring| {
        (0..SECTORS).flat_map(move |sector| {
            let [here, beside] = [sector, sector + 1].map(|sector| corner(ring - 1, sector));
            let [ahead, ahead_beside] = [sector, sector + 1].map(|sector| corner(ring, sector));
            [[here, ahead, beside], [beside, ahead, ahead_beside]]
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn outline_has_no_line_across_its_gaps() {
        let [a, b, c, d] = [[0.0, 0.0], [0.0, 1.0], [0.0, 2.0], [0.0, 3.0]];
        assert_eq!(pieces(&[Some(a), None, Some(b), Some(c), None, Some(d)]), [vec![b, c], vec![d, a]]);
        assert_eq!(pieces(&[Some(a), Some(b), Some(c)]), [[a, b, c, a]]);
        assert_eq!(pieces(&[None, Some(b), None]), [[b]]);
        assert!(pieces(&[None, None]).is_empty());
    }
}
