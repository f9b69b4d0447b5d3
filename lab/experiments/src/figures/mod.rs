//! Data of pictures like Figures 6, 8, 12, 13 and 15 of Jorge et al. 2021, without the drawing.

mod beam;
mod patterns;
mod walls;

use headrace_deliver::pictures::polyline;

use crate::runs::{Dive, Sample};

pub(crate) use beam::{Footprint, Footprints, footprints};
pub(crate) use patterns::{PhaseShift, Sectors, phase_shift, sectors};
pub(crate) use walls::{AT_GAPS, PHASES, Panel, Walls, walls};

/// A sample on the unrolled wall.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Place {
    /// Head number.
    pub head: u16,
    /// Distance along the tunnel from the start of the picture, m.
    pub x_m: f64,
    /// Arc length from the floor's centre, m.
    pub arc_m: f64,
}

/// A piece of a head's track over the unrolled wall. A piece does not cross the seam.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Way {
    /// Head number.
    pub head: u16,
    /// Distance along the tunnel from the picture's start, and arc length, of each point, m.
    pub points: Vec<[f64; 2]>,
}

/// The stretch of tunnel that a figure shows.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Window {
    from_m: f64,
    length_m: f64,
}

impl Window {
    fn has(&self, x_m: f64) -> bool {
        (0.0..=self.length_m).contains(&(x_m - self.from_m))
    }

    /// The samples of the wall within the window, in time order for each head.
    fn places(&self, dive: &Dive) -> Vec<Place> {
        let within = dive.heads.iter().flatten().filter(|s| s.of_wall && self.has(s.at.x()));
        within.map(|s| Place { head: s.head, x_m: s.at.x() - self.from_m, arc_m: s.arc_m }).collect()
    }

    /// The heads' tracks within the window, and one step beyond the window.
    fn ways(&self, dive: &Dive) -> Vec<Way> {
        let mut ways = Vec::new();
        for samples in &dive.heads {
            let point = |s: &Sample| [s.at.x() - self.from_m, s.arc_m];
            let near = samples.windows(2).filter(|pair| pair.iter().any(|s| self.has(s.at.x())));
            let steps = near.filter_map(|pair| match pair {
                [a, b] if a.of_wall && b.of_wall => Some((a.head, point(a), point(b))),
                _ => None,
            });
            for (head, from, to) in steps {
                add_step(&mut ways, head, dive.profile.perimeter_m(), from, to);
            }
        }
        ways
    }
}

/// Appends a step to the last track if the step continues it; otherwise begins a new track.
///
/// A step over the seam is split into two steps that end at the seam.
fn add_step(ways: &mut Vec<Way>, head: u16, perimeter_m: f64, from: [f64; 2], to: [f64; 2]) {
    for [begin, end] in polyline::over_seam(perimeter_m, from, to) {
        match ways.last_mut() {
            // If a step ends on the seam, its second part has no length and is skipped.
            _ if (begin[0] - end[0]).abs() + (begin[1] - end[1]).abs() <= 0.0 => (),
            Some(way) if way.head == head && way.points.last() == Some(&begin) => way.points.push(end),
            _ => ways.push(Way { head, points: vec![begin, end] }),
        }
    }
}

#[cfg(test)]
mod tests;
