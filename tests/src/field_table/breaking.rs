//! A random fault of one device of a vehicle, drawn from a seed.

use headrace_geometry::math;
use headrace_sensor::device::Sense;
use headrace_simulator::Scene;

use crate::random_dives::Draw;

/// Kinds of device faults.
pub const FAULTS: [&str; 5] = ["stick", "jump", "die", "return", "babble"];
/// Senses (quantities measured) of the devices that may fail.
pub const SENSES: [Sense; 5] =
    [Sense::Head, Sense::Echosounder, Sense::Depth, Sense::Inertial, Sense::Tether];

/// A device and the fault that it has during a dive.
#[derive(Debug, Clone)]
pub struct DeviceFault {
    /// Sense of the device: the quantity that it measures.
    pub sense: Sense,
    /// Name of the device.
    pub sensor: String,
    /// One of [`FAULTS`]. With `die`, the device dies for good. With `return`, it dies and later recovers.
    pub fault: &'static str,
    /// Start of the fault, seconds after the start of the dive.
    pub from_s: f64,
    /// Duration of the fault, seconds; `None` means to the end of the dive.
    pub for_s: Option<f64>,
    /// Size of the fault `jump`: degrees for a head or an inertial unit, m for other devices.
    pub size: f64,
}

impl DeviceFault {
    /// The fault that belongs to a seed, in a dive of `duration_s`. Consecutive seeds take the senses and faults in
    /// turn. All other values are drawn at random.
    pub fn of(seed: u64, plain: &Scene, duration_s: f64) -> Self {
        let mut draw = Draw::new(seed ^ 0xb4ea_4a6e);
        let turn = usize::try_from(seed).unwrap();
        let sense = SENSES[turn % SENSES.len()];
        let fault = FAULTS[turn / SENSES.len() % FAULTS.len()];
        let fitting: Vec<&str> = {
            let sensors = plain.facts().sensors.iter();
            sensors.filter(|sensor| sensor.sense == sense).map(|sensor| sensor.id.as_str()).collect()
        };
        let from_s = duration_s * draw.between(0.2, 0.7);
        let length_s = math::exp(draw.between(0.0, math::ln(60.0)));
        let lasts = fault == "die" || draw.below(4) == 0;
        // The smallest jumps are too small for any check. The largest jumps must be detected.
        let [least, most] = match sense {
            Sense::Head | Sense::Inertial => [1.0, 40.0],
            _ => [0.05, 5.0],
        };
        let size = math::exp(draw.between(math::ln(least), math::ln(most)));
        Self {
            sense,
            sensor: fitting[draw.below(fitting.len())].to_owned(),
            fault,
            from_s,
            for_s: (fault == "return" || !lasts).then_some(length_s),
            size: if draw.below(2) == 0 { size } else { -size },
        }
    }

    /// TOML text of the simulator effect that causes the fault.
    pub fn effect(&self) -> String {
        let kind = if self.fault == "return" { "die" } else { self.fault };
        let size = if kind == "jump" { format!("size = {:.3}\n", self.size) } else { String::new() };
        let length = self.for_s.map(|for_s| format!("for_s = {for_s:.3}\n")).unwrap_or_default();
        format!(
            "[effects.device_faults]\nsensors = [{:?}]\nkind = {kind:?}\nfrom_s = {:.3}\n{length}{size}",
            self.sensor, self.from_s
        )
    }
}
