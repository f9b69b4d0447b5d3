//! The chapter on the measured wall: maps, profile and cross-sections.

use headrace_geometry::math;
use headrace_monitor::report::Report;

use super::figures::{self, SECTIONS_EACH};
use super::tables;
use super::wall::Wall;
use crate::document::Block;

/// Largest number of cross-sections if their distance is not given.
const MOST_SECTIONS: f64 = 24.0;
/// Distances between cross-sections, m.
const STEPS_M: [f64; 10] = [1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0, 500.0, 1000.0];

/// Chapter on the wall in comparison with the design. `every_m` is the distance between cross-sections, m.
pub(super) fn chapter(report: &Report, wall: &Wall, extent_m: [f64; 2], every_m: Option<f64>) -> Vec<Block> {
    let mut blocks = vec![Block::Heading("Measured wall and design".to_owned())];
    if wall.is_empty() {
        blocks.push(Block::Paragraph("No sample of the wall was measured.".to_owned()));
        return blocks;
    }
    blocks.push(Block::Paragraph(
        "Deviation is the distance of the samples from the design profile, along rays from its reference point. Outside \
         the design is positive, inside is negative. Deposits, boulders and missing lining are not distinguished from one \
         another. Standard deviations of the deviation are not stated."
            .to_owned(),
    ));
    blocks.push(Block::Figure(
        figures::deviation(wall, extent_m),
        "Mean deviation of the unrolled wall from the design profile, m. Dark is inside the design, light outside. White: no \
         samples."
            .to_owned(),
    ));
    if !report.wall_stretches.is_empty() {
        blocks.push(Block::Subheading("Stretches outside the design".to_owned()));
        blocks.push(Block::Table(tables::off_design(report)));
    }
    blocks.push(Block::Subheading("Longitudinal profile".to_owned()));
    blocks.push(Block::Figure(
        figures::profile(wall, extent_m),
        "Mean deviation from the design within a quarter of an hour of crown, left wall, right wall and floor, m. Left and \
         right as seen along the tunnel from the portal. Gaps: no samples."
            .to_owned(),
    ));
    blocks.extend(cross_sections(report, wall, extent_m, every_m));
    blocks
}

fn cross_sections(report: &Report, wall: &Wall, extent_m: [f64; 2], every_m: Option<f64>) -> Vec<Block> {
    let every_m = every_m.unwrap_or_else(|| usual_step_m(extent_m[1] - extent_m[0]));
    let places_m = places_m(extent_m, every_m);
    let [from_m, to_m] = wall.around(0.0, report.target_m);
    let length_m = to_m - from_m;
    let mut blocks = vec![
        Block::Subheading("Cross-sections".to_owned()),
        Block::Paragraph(format!(
            "A cross-section every {every_m} m, seen along the tunnel from the portal. Dashed: design. Solid with dots: mean \
             of the samples of {length_m} m of wall in each eighth of an hour. Grid lines are 1 m apart. The numbers are the \
             section's largest deviations inwards and outwards."
        )),
    ];
    for chunk in places_m.chunks(SECTIONS_EACH) {
        let names =
            [chunk.first(), chunk.last()].map(|x_m| x_m.map_or_else(String::new, |x_m| format!("{x_m:.2}")));
        let drawing = figures::cross_sections(wall, report, chunk);
        let [first, last] = names;
        blocks.push(Block::Figure(drawing, format!("Cross-sections from chainage {first} m to {last} m.")));
    }
    blocks
}

/// Distance between the cross-sections of an extent, if the user gives no distance.
pub(super) fn usual_step_m(length_m: f64) -> f64 {
    STEPS_M.into_iter().find(|step_m| length_m / step_m <= MOST_SECTIONS).unwrap_or(STEPS_M[9])
}

/// Multiples of `every_m` within an extent.
pub(super) fn places_m([from_m, to_m]: [f64; 2], every_m: f64) -> Vec<f64> {
    let first = -math::floor_to_i64(-from_m / every_m);
    let places = (first..).map(|number| number as f64 * every_m);
    places.take_while(|x_m| *x_m < to_m).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cross_sections_are_at_round_chainages_within_the_extent() {
        assert_eq!(places_m([4.5, 8.0], 1.0), [5.0, 6.0, 7.0]);
        assert_eq!(places_m([-3.0, 5.0], 2.5), [-2.5, 0.0, 2.5]);
        assert!(places_m([1.1, 1.9], 1.0).is_empty());
    }

    #[test]
    fn usual_distance_gives_at_most_24_cross_sections() {
        for (length_m, step_m) in [(3.0, 1.0), (45.0, 2.0), (7000.0, 500.0), (90_000.0, 1000.0)] {
            assert!((usual_step_m(length_m) - step_m).abs() < 1e-9, "{length_m}");
        }
    }
}
