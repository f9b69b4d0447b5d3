//! Tests that the pictures are well-formed, reproducible and have the expected content.

use headrace_deliver::pictures::xml::well_formed;

use super::*;
use crate::figures::{self, AT_GAPS, PHASES, Walls};

fn check(svg: &str, says: &[&str]) {
    well_formed(svg).unwrap();
    assert!(svg.len() < 700_000, "{} bytes", svg.len());
    assert!(!svg.contains("NaN") && !svg.contains("inf"));
    for words in says {
        assert!(svg.contains(words), "{words:?} isn't said");
    }
}

#[test]
fn figure_6_shows_evenly_spaced_passes_and_a_faster_head() {
    let figure = figures::phase_shift().unwrap();
    let spaced_m = figure.t_x_m / 4.0;
    assert!((figure.t_x_m - 0.197 * 4.8).abs() < 1e-9);
    assert_eq!(figure.at_crown.len(), 8);
    for pair in figure.at_crown.windows(2) {
        // The distances aren't exact, because adjacent heads ping the crown at slightly different angles. One step of
        // 2.4 degrees shifts a pass by 0.006 m.
        assert!((pair[1].1 - pair[0].1 - spaced_m).abs() < 0.1 * spaced_m, "{:?}", figure.at_crown);
    }
    assert_eq!(figure.faster.len(), 8, "one track for each turn");
    let svg = patterns::phase_shift(&figure);
    assert_eq!(svg, patterns::phase_shift(&figures::phase_shift().unwrap()));
    check(
        &svg,
        &[
            "Figure 6",
            "head 3",
            "T_x/s = 0.236 m",
            "about T_x/s",
            "4 times as fast",
            "distance along the tunnel, m",
            "9:00 left",
        ],
    );
}

#[test]
fn long_and_short_pass_distances_in_figure_8_have_the_expected_sum() {
    let figure = figures::sectors().unwrap();
    let gaps: Vec<f64> = figure.at_line.windows(2).map(|pair| pair[1] - pair[0]).collect();
    assert!(gaps.len() >= 4, "{gaps:?}");
    for pair in gaps.windows(2) {
        assert!((pair[0] + pair[1] - 2.0 * figure.t_x_m).abs() < 0.03, "{gaps:?}");
        let short_m = pair[0].min(pair[1]);
        assert!((short_m - figure.alternating_m[0]).abs() < 0.03, "{gaps:?} {:?}", figure.alternating_m);
    }
    assert!(figure.at_middle.windows(2).all(|pair| (pair[1] - pair[0] - figure.t_x_m).abs() < 0.03));
    check(&patterns::sectors(&figure), &["Figure 8", "sum 2 T_x/s = 2.1", "long 1.7", "short 0.4", "head 1"]);
}

#[test]
fn figure_15_names_both_beams() {
    let svg = beam::footprints(&figures::footprints().unwrap());
    check(&svg, &["Figure 15", "1.4 deg:", "2.4 deg:", "0.24 m", "range, m", "angle from straight down"]);
}

fn drawn(configurations: &[(u8, &'static str, bool, bool)]) -> (Walls, String) {
    let figure = figures::walls(configurations, &|_| ()).unwrap();
    let svg = walls::walls("Walls", &figure);
    assert_eq!(figure.panels.len(), configurations.len());
    for panel in &figure.panels {
        assert_eq!(panel.distances_m.len(), 40 * 100);
        let close = panel.distances_m.iter().filter(|m| **m <= figure.most_m).count();
        assert!(close * 100 >= panel.distances_m.len() * 90, "the scale covers only {close} cells");
    }
    (figure, svg)
}

#[test]
fn figure_12_passes_are_evenly_spaced_only_if_head_phases_are_aligned() {
    let (figure, svg) = drawn(&PHASES[..3]);
    let sectors = &figure.panels[2];
    assert!(
        sectors.unseen_m.is_empty(),
        "sectors without their delay are the same sectors: {:?}",
        sectors.unseen_m
    );
    let times = |k: usize| figure.panels[k].widest.unwrap().length_m() / figure.panels[k].t_x_m;
    assert!(times(0) > 1.1 && (times(1) - 1.0).abs() < 0.05, "{} {}", times(0), times(1));
    assert!(figure.panels.iter().all(|panel| panel.unseen_m.is_empty()));
    check(
        &svg,
        &[
            "2 heads, SLOW",
            "phase shift, unaligned",
            "phase shift, aligned",
            "mm off",
            "and more",
            "samples is drawn",
        ],
    );
}

#[test]
fn figure_13_shows_side_wall_gaps_in_phase_shift_layout_and_unseen_strips_in_sector_layout() {
    let (figure, svg) = drawn(&[AT_GAPS[1], AT_GAPS[3]]);
    let [phase, sector] = figure.panels.as_slice() else { panic!("two panels") };
    let gap = phase.widest.unwrap();
    let clock = figure.profile.clock(gap.arc_m);
    assert!(["3:00", "9:00"].contains(&clock.as_str()), "{clock}");
    assert!(gap.length_m() > 1.9 * phase.t_x_m, "{gap:?} {}", phase.t_x_m);
    assert!(phase.wide_m.len() >= 2 && phase.wide_m.iter().any(|[a, b]| (*a..*b).contains(&gap.arc_m)));
    let inside = phase.samples.iter().filter(|sample| {
        (sample.arc_m - gap.arc_m).abs() < 0.3
            && sample.x_m > gap.x_m[0] + 0.05
            && sample.x_m < gap.x_m[1] - 0.05
    });
    assert_eq!(inside.count(), 0, "samples where nothing is seen");
    assert!(phase.unseen_m.is_empty() && !sector.unseen_m.is_empty(), "{:?}", sector.unseen_m);
    for [from_m, to_m] in &sector.unseen_m {
        let seen = sector.samples.iter().filter(|s| s.arc_m > from_m + 0.1 && s.arc_m < to_m - 0.1);
        assert_eq!(seen.count(), 0);
    }
    check(
        &svg,
        &["4 heads, MEDIUM", "sector offset, aligned", "no sample along the whole stretch", "T_x up to"],
    );
}
