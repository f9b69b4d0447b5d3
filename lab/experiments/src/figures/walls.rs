//! Figures 12 and 13: samples on a stretch of wall, and its distance from the Poisson surface.

use headrace_geometry::math::{self, TAU};
use headrace_geometry::tunnel::Profile;

use super::{Place, Window};
use crate::Spread;
use crate::meshes::{LENGTH_M, cloud, poisson, setting};
use crate::runs::{Dive, SPEED_MPS};
use crate::spacing::passes_of;
use crate::surface::{MeshIndex, wall};
use crate::{ExperimentError, Progress};

/// Length of the stretch of wall in the figures, m.
const SHOWN_M: f64 = 12.0;
/// Chainage at which the simulated dives start, m.
const START_M: f64 = 5.0;
/// Number of cells along the stretch, and around the wall.
const CELLS: [u32; 2] = [40, 100];
/// Number of lines along the wall on which passes are counted.
const LINES: u32 = 360;
/// Another head counts as occluding a line on the wall if the line's largest gap exceeds this multiple of the usual
/// gap.
const IN_SHADOW: f64 = 1.5;
/// Share of cells whose distances lie within the colour scale.
///
/// The cells at a floor's corners lie beyond the scale, because a Poisson surface rounds corners off.
const SCALE_SHARE: f64 = 0.93;

/// Number of heads, their mode, whether they are in sector offset, and whether their phases are aligned.
type Configuration = (u8, &'static str, bool, bool);

/// Figure 12: two heads with and without their phases aligned.
pub(crate) const PHASES: [Configuration; 4] =
    [(2, "slow", false, false), (2, "slow", false, true), (2, "slow", true, false), (2, "slow", true, true)];
/// Figure 13: heads that occlude the wall from each other.
pub(crate) const AT_GAPS: [Configuration; 4] = [
    (3, "medium", false, true),
    (4, "medium", false, true),
    (3, "medium", true, true),
    (4, "medium", true, true),
];

/// Panels side by side, which all show the same stretch.
#[derive(Debug, Clone)]
pub(crate) struct Walls {
    /// The tunnel's profile.
    pub profile: Profile,
    /// Speed, m/s.
    pub speed_mps: f64,
    /// Length of the dives, m.
    pub dive_m: f64,
    /// Length of the stretch shown, m.
    pub length_m: f64,
    /// The panels, one for each configuration of the heads.
    pub panels: Vec<Panel>,
    /// Upper end of the colour scale, m. Only a few cells have larger distances.
    pub most_m: f64,
}

/// The stretch of wall as sampled by one configuration.
#[derive(Debug, Clone)]
pub(crate) struct Panel {
    /// Number of heads.
    pub heads: u8,
    /// Mode of the heads.
    pub mode: &'static str,
    /// Whether the heads are in sector offset instead of phase shift.
    pub sectors: bool,
    /// Whether the heads' phases are aligned.
    pub aligned: bool,
    /// Distance T_x between passes of a single head, divided by the number of heads, m.
    pub t_x_m: f64,
    /// Samples of the stretch, in time order for each head.
    pub samples: Vec<Place>,
    /// Number of cells along the stretch, and around the wall.
    pub cells: [u32; 2],
    /// Unsigned distance of each cell's centre from the surface, m. The cells around the wall are consecutive.
    pub distances_m: Vec<f64>,
    /// Mean distance of the cells from the surface, m.
    pub mean_m: f64,
    /// The longest gap between passes along the tunnel, of all lines with at least two passes.
    pub widest: Option<Gap>,
    /// Arc lengths, m, of the start and end of each strip of wall with wide gaps. A gap between passes is wide if it
    /// exceeds 1.5 times the usual gap, T_x / s.
    pub wide_m: Vec<[f64; 2]>,
    /// Arc lengths of the start and end of each strip of wall without passes, m.
    pub unseen_m: Vec<[f64; 2]>,
}

/// A gap between two passes on a line along the wall.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Gap {
    /// Arc length of the line, m.
    pub arc_m: f64,
    /// Start and end of the gap along the tunnel, from the picture's start, m.
    pub x_m: [f64; 2],
}

impl Gap {
    /// Length of the gap, m.
    pub(crate) fn length_m(&self) -> f64 {
        self.x_m[1] - self.x_m[0]
    }
}

/// Simulates dives as for the meshes, and evaluates a stretch in the middle of each dive.
///
/// Errors: no surface can be made; none with the built-in vehicles.
pub(crate) fn walls(
    configurations: &[Configuration],
    progress: Progress<'_>,
) -> Result<Walls, ExperimentError> {
    let window = Window { from_m: START_M + (LENGTH_M - SHOWN_M) / 2.0, length_m: SHOWN_M };
    let mut panels = Vec::new();
    for configuration in configurations {
        progress(&format!("a picture of {} heads' samples", configuration.0));
        let dive = setting(*configuration, LENGTH_M, 1).dive()?;
        panels.push(panel(&dive, window, *configuration)?);
    }
    let mut all: Vec<f64> = panels.iter().flat_map(|panel| panel.distances_m.iter().copied()).collect();
    all.sort_by(f64::total_cmp);
    let last = math::floor_to_i64(SCALE_SHARE * all.len() as f64);
    let most_m = all.get(crate::index(last)).copied().unwrap_or_default();
    let profile = headrace_geometry::tunnel::shapes::ceran_blueprint()?;
    // The colour scale ends at a whole centimetre.
    let most_m = (most_m * 100.0).ceil().max(1.0) / 100.0;
    Ok(Walls { profile, speed_mps: SPEED_MPS, dive_m: LENGTH_M, length_m: SHOWN_M, panels, most_m })
}

fn panel(
    dive: &Dive,
    window: Window,
    (heads, mode, sectors, aligned): Configuration,
) -> Result<Panel, ExperimentError> {
    let t_x_m = SPEED_MPS * dive.ping_period_s * TAU / dive.step_rad / f64::from(heads);
    let distances_m = distances(dive, window)?;
    let mean_m = Spread::of(distances_m.iter().copied()).mean_m;
    let lines = lines(dive, window);
    let perimeter_m = dive.profile.perimeter_m();
    let unseen_m = strips(&lines, perimeter_m, |line| line.passes_m.is_empty());
    let wide = |line: &Line| line.widest().is_some_and(|gap| gap.length_m() > IN_SHADOW * t_x_m);
    let (widest, wide_m) = (widest(&lines), strips(&lines, perimeter_m, wide));
    let samples = window.places(dive);
    Ok(Panel {
        heads,
        mode,
        sectors,
        aligned,
        t_x_m,
        samples,
        cells: CELLS,
        distances_m,
        mean_m,
        widest,
        wide_m,
        unseen_m,
    })
}

fn distances(dive: &Dive, window: Window) -> Result<Vec<f64>, ExperimentError> {
    let (mesh, bin_m) = poisson(dive, &cloud(dive))?;
    let index = MeshIndex::new(&mesh, bin_m).ok_or(ExperimentError::NoSurface)?;
    let middle = |number: u32, of: u32| (f64::from(number) + 0.5) / f64::from(of);
    let distance_m = |(i, k)| {
        let x_m = window.from_m + window.length_m * middle(i, CELLS[0]);
        let arc_m = dive.profile.perimeter_m() * middle(k, CELLS[1]);
        index.distance_m(wall::place(&dive.profile, x_m, arc_m, 0.0))
    };
    let cells = (0..CELLS[0]).flat_map(|i| (0..CELLS[1]).map(move |k| (i, k)));
    Ok(cells.map(distance_m).collect())
}

/// A line along the wall, with the passes over it within the stretch.
struct Line {
    arc_m: f64,
    passes_m: Vec<f64>,
}

impl Line {
    fn widest(&self) -> Option<Gap> {
        let gaps = self.passes_m.windows(2).filter_map(|pair| match pair {
            [from, to] => Some(Gap { arc_m: self.arc_m, x_m: [*from, *to] }),
            _ => None,
        });
        gaps.max_by(|a, b| a.length_m().total_cmp(&b.length_m()))
    }
}

fn lines(dive: &Dive, window: Window) -> Vec<Line> {
    let perimeter_m = dive.profile.perimeter_m();
    let line = |number: u32| {
        let arc_m = perimeter_m * (f64::from(number) + 0.5) / f64::from(LINES);
        let all = dive.heads.iter().flat_map(|samples| passes_of(dive, samples, arc_m));
        let mut passes_m: Vec<f64> =
            all.filter(|x_m| window.has(*x_m)).map(|x_m| x_m - window.from_m).collect();
        passes_m.sort_by(f64::total_cmp);
        Line { arc_m, passes_m }
    };
    (0..LINES).map(line).collect()
}

/// The largest gap between passes. If another head occludes several adjacent lines, the gap of their middle line is
/// returned.
fn widest(lines: &[Line]) -> Option<Gap> {
    let mut lengths: Vec<f64> = lines.iter().filter_map(Line::widest).map(|gap| gap.length_m()).collect();
    lengths.sort_by(f64::total_cmp);
    let usual_m = lengths.get(lengths.len() / 4).copied()?;
    let shadowed = |line: &&Line| line.widest().is_some_and(|gap| gap.length_m() > IN_SHADOW * usual_m);
    let length_m = |line: &Line| line.widest().map_or(0.0, |gap| gap.length_m());
    let (number, worst) = lines.iter().enumerate().max_by(|a, b| length_m(a.1).total_cmp(&length_m(b.1)))?;
    let before = lines.iter().take(number).rev().take_while(shadowed).count();
    let after = lines.iter().skip(number + 1).take_while(shadowed).count();
    // Index of the middle one of the occluded lines.
    let middle = (2 * number + after).saturating_sub(before) / 2;
    lines.get(middle).unwrap_or(worst).widest()
}

/// Arc lengths of the start and end of each strip made of adjacent lines that satisfy `kind`, m.
fn strips(lines: &[Line], perimeter_m: f64, kind: impl Fn(&Line) -> bool) -> Vec<[f64; 2]> {
    let apart_m = perimeter_m / f64::from(LINES);
    let mut strips: Vec<[f64; 2]> = Vec::new();
    for line in lines.iter().filter(|line| kind(line)) {
        let [from_m, to_m] = [line.arc_m - apart_m / 2.0, line.arc_m + apart_m / 2.0];
        match strips.last_mut() {
            Some(strip) if (strip[1] - from_m).abs() < apart_m / 4.0 => strip[1] = to_m,
            _ => strips.push([from_m, to_m]),
        }
    }
    strips
}
