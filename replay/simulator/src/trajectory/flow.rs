//! Flow of the water along the tunnel.

use crate::stretch::Stretch;

/// Speed of the water in each of several stretches of the tunnel, m/s. The water is stationary outside these stretches.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Flow(Vec<(Stretch, f64)>);

impl Flow {
    /// Adds a stretch with flow `speed_mps`, positive towards growing chainage. Returns false if the stretch overlaps
    /// an existing one.
    pub(crate) fn add(&mut self, stretch: Stretch, speed_mps: f64) -> bool {
        let is_free = self.0.iter().all(|(other, _)| !other.meets(&stretch));
        if is_free {
            self.0.push((stretch, speed_mps));
        }
        is_free
    }

    /// Speed of the water at a chainage, m/s.
    pub(super) fn at_mps(&self, chainage_m: f64) -> f64 {
        self.0.iter().find(|(stretch, _)| stretch.has(chainage_m)).map_or(0.0, |(_, speed_mps)| *speed_mps)
    }

    /// The first chainage on the way from `from_m` to `to_m` at which the flow may change; `to_m` if there is none.
    pub(super) fn next_change_m(&self, from_m: f64, to_m: f64) -> f64 {
        let forwards = to_m >= from_m;
        let changes = self.0.iter().flat_map(|(stretch, _)| [stretch.from_m, stretch.to_m]);
        if forwards {
            changes.filter(|change_m| *change_m > from_m).fold(to_m, f64::min)
        } else {
            changes.filter(|change_m| *change_m < from_m).fold(to_m, f64::max)
        }
    }
}

impl core::fmt::Display for Flow {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        for (number, (stretch, speed_mps)) in self.0.iter().enumerate() {
            let and = if number > 0 { ", " } else { "" };
            match *stretch {
                Stretch::ALL => write!(f, "{and}{speed_mps} m/s")?,
                Stretch { from_m, to_m } => {
                    write!(f, "{and}{speed_mps} m/s from {:.0} to {to_m:.0} m", from_m.max(0.0))?;
                }
            }
        }
        if self.0.is_empty() { write!(f, "0 m/s") } else { Ok(()) }
    }
}
