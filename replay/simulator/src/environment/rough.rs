//! Roughness of the wall: random heights relative to the smooth wall. Heights of nearby points are correlated.
//!
//! A point of the wall has the same height for every beam, sensor and pass. Averaging several returns therefore reduces
//! noise, but not roughness.

use headrace_config::{ConfigError, Section};
use headrace_geometry::frames::{Point3, Tunnel};
use headrace_geometry::math;

use super::keys;
use super::scatter::Scatter;
use crate::stretch::Stretch;

/// Lower limit of the cosine of incidence when a height is converted to a change of range. At more grazing incidence,
/// the bumps of the wall hide the hollows between them.
const LEAST_COSINE: f64 = 0.25;
/// Standard deviation of the sum of four 16-bit random numbers, in units of the range of one such number: the square
/// root of 4 / 12.
const SUM_SD: f64 = 0.577_350_269_189_625_8;

/// Rough stretches of the tunnel, each with the heights of its wall.
#[derive(Debug, Clone, Default)]
pub(super) struct Roughness(Vec<(Stretch, Heights)>);

/// Heights of a stretch of rough wall: random numbers at the nodes of a cubic lattice, interpolated between the
/// nodes.
#[derive(Debug, Clone, Copy)]
struct Heights {
    sd_m: f64,
    length_m: f64,
    seed: u64,
}

impl Roughness {
    /// Reads `[[tunnel.rough]]`.
    ///
    /// Keys: `from_m`, `to_m`; the standard deviation `sd_m` of the heights, from 0.001 to 0.3; the correlation length
    /// `length_m`, from 0.02 to 5 (0.3), beyond which heights are independent; and `seed` (1).
    ///
    /// Errors: a key is missing or out of range, or stretches overlap.
    pub(super) fn parse(tables: Vec<Section<'_>>, tunnel_m: f64) -> Result<Self, ConfigError> {
        let mut all: Vec<(Stretch, Heights)> = Vec::new();
        for table in tables {
            let stretch = Stretch::read(&table, tunnel_m)?;
            if all.iter().any(|(other, _)| other.meets(&stretch)) {
                let problem = "begins a stretch that overlaps an earlier rough stretch";
                return Err(table.invalid("from_m", problem));
            }
            let sd_m = table.required("sd_m", table.number("sd_m", 0.001..=0.3)?)?;
            let length_m = table.number("length_m", 0.02..=5.0)?.unwrap_or(0.3);
            let seed = keys::seed(&table)?;
            table.finish()?;
            all.push((stretch, Heights { sd_m, length_m, seed }));
        }
        Ok(Self(all))
    }

    /// Difference between the range to the rough wall and the range to the smooth wall, m.
    ///
    /// The beam meets the smooth wall at `point`. The range to this point is `range_m`, and `cosine` is the cosine of
    /// the beam's incidence.
    pub(super) fn deeper_m(
        &self,
        point: Point3<Tunnel>,
        (range_m, cosine): (f64, f64),
        chainage_m: impl FnOnce() -> f64,
    ) -> f64 {
        if self.0.is_empty() {
            return 0.0;
        }
        let chainage_m = chainage_m();
        let Some((_, heights)) = self.0.iter().find(|(stretch, _)| stretch.has(chainage_m)) else {
            return 0.0;
        };
        // The limit keeps a bump of the rough wall from reaching more than halfway to the sonar.
        (heights.at_m(point) / cosine.max(LEAST_COSINE)).max(-range_m / 2.0)
    }
}

impl Heights {
    /// Distance from the smooth wall outwards to the rough wall, m.
    fn at_m(&self, point: Point3<Tunnel>) -> f64 {
        let places = [point.x(), point.y(), point.z()].map(|x_m| {
            let share = x_m / self.length_m;
            let node = math::floor_to_i64(share);
            (node, share - node as f64)
        });
        let (mut sum, mut squares) = (0.0, 0.0);
        for corner in 0..8_u32 {
            let (mut nodes, mut weight) = ([0_i64; 3], 1.0);
            for (axis, (node, within)) in places.iter().enumerate() {
                let upper = (corner >> axis) & 1 == 1;
                nodes[axis] = node + i64::from(upper);
                weight *= if upper { *within } else { 1.0 - within };
            }
            sum += weight * self.number(nodes);
            squares += weight * weight;
        }
        // A weighted mean of several random numbers has a smaller standard deviation than each number. The division by
        // the root of the sum of squared weights restores the standard deviation `sd_m`.
        self.sd_m * sum / math::sqrt(squares)
    }

    /// Random number of a lattice node, with mean zero and standard deviation one.
    fn number(&self, nodes: [i64; 3]) -> f64 {
        let mut hash = self.seed;
        for node in nodes {
            hash = Scatter(hash ^ node.cast_unsigned()).next();
        }
        let sum: u64 = (0..4).map(|word| (hash >> (16 * word)) & 0xFFFF).sum();
        (sum as f64 / 65_535.0 - 2.0) / SUM_SD
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEIGHTS: Heights = Heights { sd_m: 0.03, length_m: 0.3, seed: 7 };

    fn at_m(x_m: f64, y_m: f64) -> f64 {
        HEIGHTS.at_m(Point3::new(x_m, y_m, 1.23))
    }

    fn mean(of: impl Iterator<Item = f64>) -> f64 {
        let (n, sum) = of.fold((0.0, 0.0), |(n, sum), x| (n + 1.0, sum + x));
        sum / n
    }

    #[test]
    fn rough_wall_heights_have_the_given_sd() {
        let many = || (0..100_000).map(|k| at_m(f64::from(k) * 0.137, f64::from(k % 97) * 0.211));
        assert!(mean(many()).abs() < 0.0005, "{}", mean(many()));
        let sd_m = mean(many().map(|h_m| h_m * h_m)).sqrt();
        assert!((sd_m - 0.03).abs() < 0.0005, "{sd_m}");
    }

    #[test]
    fn rough_wall_heights_are_correlated_only_within_the_given_length() {
        let alike = |apart_m: f64| {
            mean((0..50_000).map(|k| {
                let x_m = f64::from(k) * 0.371;
                at_m(x_m, 0.5) * at_m(x_m + apart_m, 0.5)
            })) / (0.03 * 0.03)
        };
        assert!(alike(0.03) > 0.9, "{}", alike(0.03));
        assert!((0.2..0.7).contains(&alike(0.2)), "{}", alike(0.2));
        assert!(alike(0.7).abs() < 0.03, "{}", alike(0.7));
    }

    #[test]
    fn rough_walls_of_different_seeds_are_independent() {
        let other = Heights { seed: 8, ..HEIGHTS };
        let product = mean((0..50_000).map(|k| {
            let at = Point3::new(f64::from(k) * 0.371, 0.2, 0.9);
            HEIGHTS.at_m(at) * other.at_m(at)
        }));
        assert!((product / (0.03 * 0.03)).abs() < 0.03, "{product}");
    }
}
