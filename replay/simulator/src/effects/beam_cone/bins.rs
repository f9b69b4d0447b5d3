//! Strength of a ping's echo over range bins.

use headrace_geometry::math;

/// Strengths in bins of equal width, which are centred on multiples of the width.
///
/// The bins implement this sentence of Jorge et al. 2021, §9.2: "we use bilinear interpolation of range values of the
/// 881L sensor to determine where the tunnel surface is". The head's picture is a grid of angle and range. An echo
/// between grid points is shared linearly among the neighbouring points. In angle, the share is the beam strength,
/// which falls linearly from the axis. The surface is the ridge of the picture. If the beam is oblique to the wall, its
/// echo is long and the ridge is wide and low, as that paper found next to corners.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Bins {
    width_m: f64,
    strengths: Vec<f64>,
    /// Index of the first bin with an echo, and one past the last bin with an echo.
    filled: (usize, usize),
}

impl Bins {
    /// Creates empty bins of width `width_m`, which must be above 0.
    pub(super) fn new(width_m: f64) -> Self {
        Self { width_m, strengths: Vec::new(), filled: (usize::MAX, 0) }
    }

    /// Adds an echo. It is shared linearly between the two bins nearest to `range_m`.
    pub(super) fn add(&mut self, range_m: f64, strength: f64) {
        let at = range_m / self.width_m;
        let Ok(below) = usize::try_from(math::floor_to_i64(at)) else { return };
        let above = at - below as f64;
        if self.strengths.len() < below + 2 {
            self.strengths.resize(below + 2, 0.0);
        }
        for (bin, share) in self.strengths.iter_mut().skip(below).zip([1.0 - above, above]) {
            *bin += share * strength;
        }
        self.filled = (self.filled.0.min(below), self.filled.1.max(below + 2));
    }

    /// Returns the range of the strongest echo, m, and empties the bins.
    ///
    /// The range is the centroid of the strongest bin and its two neighbours. Among equally strong bins, the nearest
    /// counts. Returns `None` if the bins are empty.
    pub(super) fn take_surface_m(&mut self) -> Option<f64> {
        let (from, to) = std::mem::replace(&mut self.filled, (usize::MAX, 0));
        let filled = self.strengths.get_mut(from..to)?;
        let mut strongest = (0, 0.0);
        for (bin, strength) in filled.iter().enumerate() {
            if *strength > strongest.1 {
                strongest = (bin, *strength);
            }
        }
        let first = strongest.0.saturating_sub(1);
        let (mut sum, mut moment) = (0.0, 0.0);
        for (bin, strength) in filled.iter().enumerate().skip(first).take(strongest.0 - first + 2) {
            (sum, moment) = (sum + strength, moment + strength * (from + bin) as f64);
        }
        filled.fill(0.0);
        (sum > 0.0).then(|| moment / sum * self.width_m)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn single_echo_is_found_at_its_range_and_empties_the_bins() {
        let mut bins = Bins::new(0.02);
        for range_m in [3.0, 3.001, 3.009, 3.010, 3.0199, 0.0, 12.5] {
            bins.add(range_m, 0.7);
            assert!((bins.take_surface_m().unwrap() - range_m).abs() < 1e-12, "{range_m}");
        }
        assert_eq!(bins.take_surface_m(), None);
    }

    #[test]
    fn stronger_echo_wins_and_near_echoes_merge() {
        let mut bins = Bins::new(0.02);
        bins.add(3.0, 1.0);
        bins.add(4.0, 1.5);
        assert!((bins.take_surface_m().unwrap() - 4.0).abs() < 1e-12);
        bins.add(3.00, 1.0);
        bins.add(3.02, 3.0);
        assert!((bins.take_surface_m().unwrap() - 3.015).abs() < 1e-12);
    }
}
