//! Dives for tests: a short description of vehicle and scene, with the real devices.

use std::fmt::Write as _;

use headrace_config::Document;
use headrace_devices::KINDS;
use headrace_geometry::time::{DurNs, MonoNs};
use headrace_sensor::device::Direction;

use crate::{Scene, SceneError, Simulation, TruthRow};

/// A vehicle that moves forward in a tunnel for `seconds` at a constant speed, with the effects of a scene.
#[derive(Debug, Clone)]
pub(crate) struct Dive {
    /// Keys of the scene's table `[tunnel]`.
    pub(crate) tunnel: &'static str,
    /// Id, plugin and other keys of each sensor.
    pub(crate) sensors: Vec<(&'static str, &'static str, String)>,
    /// Other tables of the vehicle file, as text.
    pub(crate) vehicle: &'static str,
    /// Keys of the scene's table `[trajectory]`.
    pub(crate) trajectory: &'static str,
    pub(crate) seconds: f64,
    pub(crate) speed_mps: f64,
    pub(crate) seed: u64,
    /// Length of the simulation's time slices; `None` for the default.
    pub(crate) slice: Option<DurNs>,
}

/// A message on a line, with its own copy of the bytes.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Said {
    pub(crate) at: MonoNs,
    pub(crate) source: u16,
    pub(crate) direction: Direction,
    pub(crate) bytes: Vec<u8>,
}

/// Result of a simulated dive.
#[derive(Debug, Clone)]
pub(crate) struct Dived {
    /// Ground truth of the measurements, in order of time, then source.
    pub(crate) rows: Vec<TruthRow>,
    pub(crate) messages: Vec<Said>,
}

impl Dive {
    /// A dive of ten seconds at 0.2 m/s on the axis of a tunnel 6 m wide and 5 m high. One head is in the mode MEDIUM
    /// with a range of 10 m.
    pub(crate) fn with_head() -> Self {
        Self::with_heads(&[[0.0; 3]])
    }

    /// Adds heads `sonar_0`, `sonar_1`, ... at the positions `places`, all facing forward.
    pub(crate) fn with_heads(places: &[[f64; 3]]) -> Self {
        let ids = ["sonar_0", "sonar_1", "sonar_2", "sonar_3"];
        let head = |(place, id): (&[f64; 3], &'static str)| {
            (id, "imagenex881", format!("mode = \"medium\"\nrange_m = 10\nposition_m = {place:?}"))
        };
        Self {
            tunnel: "profile = \"rectangle\"\nwidth_m = 6\nheight_m = 5",
            sensors: places.iter().zip(ids).map(head).collect(),
            vehicle: "",
            trajectory: "",
            seconds: 10.0,
            speed_mps: 0.2,
            seed: 1,
            slice: None,
        }
    }

    /// Adds an echosounder `ping` that looks to the left and pings twenty times a second.
    pub(crate) fn with_sounder() -> Self {
        let sounder = ("ping", "ping1d", "angles_deg = [0, 0, 90]\ninterval_ms = 50".to_owned());
        Self { sensors: vec![sounder], ..Self::with_head() }
    }

    /// Writes a scene file with these effects as text, and parses it.
    pub(crate) fn scene(&self, effects: &str) -> Result<Scene, SceneError> {
        let mut vehicle =
            format!("target_m = 0.5\n[tunnel]\n{}\nlength_m = 5000\n{}\n", self.tunnel, self.vehicle);
        for (id, plugin, keys) in &self.sensors {
            writeln!(vehicle, "[[sensors]]\nid = \"{id}\"\nplugin = \"{plugin}\"\n{keys}").unwrap();
        }
        let scene = format!(
            "vehicle = \"vehicle.toml\"\nseed = {}\n[trajectory]\n{}\n[[trajectory.legs]]\nspeed_mps = {}\n\
             distance_m = {}\n{effects}\n",
            self.seed,
            self.trajectory,
            self.speed_mps,
            self.seconds * self.speed_mps
        );
        Scene::parse(Document::new("scene.toml", &scene), &KINDS, &|_| Ok(vehicle.clone().into_bytes()), None)
    }

    /// Creates the simulation of the dive with these effects.
    pub(crate) fn simulation(&self, effects: &str) -> Result<Simulation, SceneError> {
        let scene = self.scene(effects)?;
        let simulation = Simulation::with_truth(&scene)?;
        Ok(match self.slice {
            Some(slice) => simulation.in_slices(slice),
            None => simulation,
        })
    }

    /// Simulates the whole dive with these effects.
    pub(crate) fn dive(&self, effects: &str) -> Dived {
        let mut simulation = self.simulation(effects).unwrap_or_else(|why| panic!("{why}"));
        let mut messages = Vec::new();
        while let Some(message) = simulation.next_message() {
            let (at, source, direction) = (message.at, message.source, message.direction);
            messages.push(Said { at, source, direction, bytes: message.bytes.to_vec() });
        }
        let mut rows = simulation.take_truth();
        rows.sort_by_key(|row| (row.at, row.source));
        Dived { rows, messages }
    }

    /// Text of the error with which the scene with these effects is refused. Panics if it is accepted.
    pub(crate) fn refusal(&self, effects: &str) -> String {
        match self.simulation(effects) {
            Ok(_) => panic!("{effects} was accepted"),
            Err(why) => why.to_string(),
        }
    }

    /// Asserts that a scene gives the same result for any length of the simulation's time slices.
    pub(crate) fn assert_slices_dont_matter(&self, effects: &str) {
        let usual = self.dive(effects);
        assert!(!usual.rows.is_empty());
        for slice_ms in [7, 90, 20_000] {
            let other = Self { slice: Some(DurNs::from_millis(slice_ms)), ..self.clone() }.dive(effects);
            assert!(usual.messages == other.messages, "slices of {slice_ms} ms: {effects}");
            assert_eq!(usual.rows.len(), other.rows.len(), "slices of {slice_ms} ms: {effects}");
            for (a, b) in usual.rows.iter().zip(&other.rows) {
                // Results are compared as text, because in text NaN equals NaN.
                assert_eq!(format!("{a:?}"), format!("{b:?}"), "slices of {slice_ms} ms: {effects}");
            }
        }
    }
}

impl Dived {
    /// Angle and range of each ping of a sonar.
    pub(crate) fn soundings(&self, source: u16) -> Vec<(f64, Option<f64>)> {
        let rows = self.rows.iter().filter(|row| row.source == source);
        let measured = rows.filter_map(|row| row.sounding).map(|sounding| sounding.measured);
        measured.map(|sounding| (sounding.angle_rad, sounding.range_m)).collect()
    }

    /// Ranges that a source has measured, in order.
    pub(crate) fn ranges_m(&self, source: u16) -> Vec<Option<f64>> {
        self.soundings(source).into_iter().map(|(_, range_m)| range_m).collect()
    }
}

/// Asserts that the share of hits in `of` trials is within five standard deviations of its probability.
pub(crate) fn assert_share(count: usize, of: usize, probability: f64) {
    let deviation = headrace_geometry::math::sqrt(probability * (1.0 - probability) / of as f64);
    let share = count as f64 / of as f64;
    assert!((share - probability).abs() <= 5.0 * deviation, "{count} of {of}, not {probability}");
}
