//! Scenes as text, and pseudo-random numbers, for the tests in this folder. Each test file covers one subject.

use headrace_config::Document;
use headrace_geometry::frames::{Point3, Vec3};
use headrace_geometry::math;
use headrace_geometry::tunnel::shapes;

use super::*;

mod bend;
mod bodies;
#[cfg(feature = "mesh")]
mod meshes;
mod oracle;
mod refusals;
mod walls;

/// Length of the tunnels under test, m.
const LENGTH_M: f64 = 100.0;

/// Knuth's MMIX random number generator.
struct Lcg(u64);

impl Lcg {
    fn between(&mut self, least: f64, most: f64) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        least + (most - least) * ((self.0 >> 11) as f64 / (1_u64 << 53) as f64)
    }

    /// A random direction. Every second direction is nearly across the tunnel, like a profiler's beam.
    fn direction(&mut self) -> V3 {
        let flat = if self.between(0.0, 1.0) < 0.5 { 0.05 } else { 1.0 };
        loop {
            let v = [self.between(-1.0, 1.0) * flat, self.between(-1.0, 1.0), self.between(-1.0, 1.0)];
            let length = math::sqrt(v.iter().map(|c| c * c).sum());
            if (0.1..1.0).contains(&length) {
                return v.map(|c| c / length);
            }
        }
    }
}

fn try_parse(text: &str, design: &Profile) -> Result<Environment, ConfigError> {
    try_parse_with(text, design, &|name| Err(format!("no file {name}")))
}

fn try_parse_with(text: &str, design: &Profile, load: FileLoader<'_>) -> Result<Environment, ConfigError> {
    let root = Document::new("s.toml", text).root().unwrap();
    let section = root.section("tunnel").unwrap();
    let no_text = |name: &str| Err(format!("no file {name}"));
    Environment::parse(section, design, LENGTH_M, &no_text, load)
}

fn parse(text: &str, design: &Profile) -> Environment {
    try_parse(text, design).unwrap_or_else(|error| panic!("{error}"))
}

fn cast(environment: &Environment, origin: V3, direction: V3) -> Option<Hit> {
    environment.cast(to_point(origin), to_vec(direction), 200.0)
}
