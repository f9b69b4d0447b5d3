//! Figures 6 and 8: sampling patterns of heads in phase shift and in sector offset.

use headrace_geometry::math::{self, TAU};
use headrace_geometry::tunnel::Profile;
use headrace_sampling::layout::{self, HeadLayout};

use super::{Place, Way, Window, add_step};
use crate::ExperimentError;
use crate::runs::{Dive, SPEED_MPS, Setting};
use crate::spacing::passes_of;

/// Length of dive before the picture, m. It is long enough for every head to pass the picture's start.
const BEFORE_M: f64 = 4.0;
/// Chainage at which the simulated dives start, m.
const START_M: f64 = 5.0;
/// Place of the line on which the two distances between passes are shown. It is a share of head 0's sector, counted
/// from the floor's centre.
const SHARE: f64 = 0.8;
/// Angle between consecutive drawn points of the faster head's track, degrees.
const FASTER_STEP_DEG: u32 = 2;

/// Figure 6: heads in phase shift over two turns.
#[derive(Debug, Clone)]
pub(crate) struct PhaseShift {
    /// The tunnel's profile.
    pub profile: Profile,
    /// Number of heads.
    pub heads: u16,
    /// Mode of the heads.
    pub mode: &'static str,
    /// Speed, m/s.
    pub speed_mps: f64,
    /// Distance T_x between passes of a single head, m.
    pub t_x_m: f64,
    /// The picture's length, m.
    pub length_m: f64,
    /// Samples of the heads.
    pub samples: Vec<Place>,
    /// Tracks of the heads.
    pub ways: Vec<Way>,
    /// Track of a single head that turns faster, by a factor equal to the number of heads.
    pub faster: Vec<Way>,
    /// Arc length of the crown, m.
    pub crown_m: f64,
    /// Head number and position, m, of each pass over the crown, in ascending order of position.
    pub at_crown: Vec<(u16, f64)>,
}

/// Figure 8: two heads in sector offset over three sweeps, each there and back.
#[derive(Debug, Clone)]
pub(crate) struct Sectors {
    /// The tunnel's profile.
    pub profile: Profile,
    /// Mode of the heads.
    pub mode: &'static str,
    /// Speed, m/s.
    pub speed_mps: f64,
    /// Distance T_x between passes of one continuously turning head, divided by the number of heads, m.
    pub t_x_m: f64,
    /// The picture's length, m.
    pub length_m: f64,
    /// Samples of the heads.
    pub samples: Vec<Place>,
    /// Tracks of the heads.
    pub ways: Vec<Way>,
    /// Arc length of a line near one end of head 0's sector, m.
    pub line_m: f64,
    /// Positions at which head 0 passes the line, m.
    pub at_line: Vec<f64>,
    /// The two distances between passes on the line, m, by the formula of Jorge et al. 2021. The shorter one comes
    /// first.
    pub alternating_m: [f64; 2],
    /// Arc length of the middle of head 0's sector, m.
    pub middle_m: f64,
    /// Positions at which head 0 passes the middle of its sector, m.
    pub at_middle: Vec<f64>,
}

fn setting(heads: u8, mode: &'static str, layout: HeadLayout, length_m: f64) -> Setting {
    let effects = String::new();
    Setting { heads, mode, layout, aligned: true, occlusion: false, length_m, effects, seed: 1 }
}

fn pitch_m(dive: &Dive) -> f64 {
    SPEED_MPS * dive.ping_period_s * TAU / dive.step_rad
}

/// Simulates four heads in FASTEST.
///
/// Errors: none with the built-in vehicles.
pub(crate) fn phase_shift() -> Result<PhaseShift, ExperimentError> {
    const HEADS: u8 = 4;
    const MODE: &str = "FASTEST";
    let dive = setting(HEADS, MODE, HeadLayout::PhaseShift, 12.0).dive()?;
    let (profile, t_x_m) = (&dive.profile, pitch_m(&dive));
    let first = dive.heads.first().map(Vec::as_slice).unwrap_or_default();
    // The picture begins where the first head passes the floor's centre.
    let from_m = passes_of(&dive, first, 0.0).find(|x_m| *x_m > START_M + BEFORE_M).unwrap_or_default();
    let window = Window { from_m, length_m: 2.0 * t_x_m };
    let crown_m = above(profile);
    let mut at_crown = Vec::new();
    for (head, samples) in (0_u16..).zip(&dive.heads) {
        let passes = passes_of(&dive, samples, crown_m).filter(|x_m| window.has(*x_m));
        at_crown.extend(passes.map(|x_m| (head, x_m - from_m)));
    }
    at_crown.sort_by(|a, b| a.1.total_cmp(&b.1));
    Ok(PhaseShift {
        heads: u16::from(HEADS),
        mode: MODE,
        speed_mps: SPEED_MPS,
        t_x_m,
        length_m: window.length_m,
        samples: window.places(&dive),
        ways: window.ways(&dive),
        faster: faster(&dive, t_x_m / f64::from(HEADS), window.length_m),
        crown_m,
        at_crown,
        profile: dive.profile,
    })
}

fn above(profile: &Profile) -> f64 {
    let [y_m, z_m] = profile.reference();
    profile.arc_of([y_m, z_m + 1.0])
}

/// Track of a head that begins at the floor's centre and advances `gain_m` per turn, in the heads' sense of rotation.
fn faster(dive: &Dive, gain_m: f64, length_m: f64) -> Vec<Way> {
    let perimeter_m = dive.profile.perimeter_m();
    let around_m = dive.heads.first().and_then(|samples| match samples.as_slice() {
        [a, b, ..] => Some(math::wrap_signed(b.arc_m - a.arc_m, perimeter_m)),
        _ => None,
    });
    let growing = around_m.is_some_and(|around_m| around_m > 0.0);
    let [y_m, z_m] = dive.profile.reference();
    let point = |number: u32| {
        let turned_rad = f64::from(number * FASTER_STEP_DEG).to_radians();
        let (sine, cosine) = math::sin_cos(if growing { turned_rad } else { -turned_rad });
        let arc_m = match number * FASTER_STEP_DEG % 360 {
            // An exact zero lies on the seam, and can't be rounded to the wrong side of it.
            0 => 0.0,
            _ => dive.profile.arc_of([y_m + sine, z_m - cosine]),
        };
        [gain_m * turned_rad / TAU, arc_m]
    };
    let mut ways = Vec::new();
    let points = (0..).map(point).take_while(|[x_m, _]| *x_m <= length_m + 1e-9);
    let points: Vec<[f64; 2]> = points.collect();
    for pair in points.windows(2) {
        if let [from, to] = pair {
            add_step(&mut ways, 0, perimeter_m, *from, *to);
        }
    }
    ways
}

/// Simulates two heads in MEDIUM.
///
/// Errors: none with the built-in vehicles.
pub(crate) fn sectors() -> Result<Sectors, ExperimentError> {
    const HEADS: u8 = 2;
    const MODE: &str = "MEDIUM";
    let dive = setting(HEADS, MODE, HeadLayout::SectorOffset, 16.0).dive()?;
    let t_x_m = pitch_m(&dive) / f64::from(HEADS);
    let first = dive.heads.first().map(Vec::as_slice).unwrap_or_default();
    let [y_m, z_m] = dive.profile.reference();
    // Head 0 sweeps half a turn from the floor's centre, towards the side with most of its samples.
    let half_m = dive.profile.perimeter_m() / 2.0;
    let left = first.iter().filter(|sample| sample.arc_m < half_m).count() * 2 > first.len();
    let at_share = |share: f64| {
        let (sine, cosine) = math::sin_cos(share * math::PI);
        dive.profile.arc_of([y_m + if left { sine } else { -sine }, z_m - cosine])
    };
    let (line_m, middle_m) = (at_share(SHARE), at_share(0.5));
    let begin = passes_of(&dive, first, at_share(0.02)).find(|x_m| *x_m > START_M + BEFORE_M);
    let window = Window { from_m: begin.unwrap_or_default(), length_m: 3.0 * 2.0 * t_x_m };
    let passes = |arc_m: f64| {
        let passes = passes_of(&dive, first, arc_m).filter(|x_m| window.has(*x_m));
        passes.map(|x_m| x_m - window.from_m).collect::<Vec<_>>()
    };
    Ok(Sectors {
        mode: MODE,
        speed_mps: SPEED_MPS,
        t_x_m,
        length_m: window.length_m,
        samples: window.places(&dive),
        ways: window.ways(&dive),
        line_m,
        at_line: passes(line_m),
        alternating_m: layout::alternating_m(t_x_m * f64::from(HEADS), usize::from(HEADS), SHARE)?,
        middle_m,
        at_middle: passes(middle_m),
        profile: dive.profile,
    })
}
