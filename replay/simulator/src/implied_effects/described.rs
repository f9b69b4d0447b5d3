//! Effects implied by a scene's descriptions: water, linings, a cable, thrusters, and features of the tunnel.

use headrace_config::{ConfigError, Section};
use headrace_geometry::math;
use headrace_geometry::site::{Site, fresh_water_sound_speed_mps};
use headrace_sensor::device::Sense;

use super::call::{Call, number};
use crate::environment::Environment;
use crate::facts::Facts;
use crate::stretch::Stretch;
use crate::trajectory::Ground;

/// A known cable, selected by name.
///
/// Strength and diameter are from the maker's page (docs.bluerobotics.com/fathom-r2: 7.6 mm, 350 lb). The stiffness EA
/// is the strength divided by 3.6 %, the strain at which aramid breaks (DuPont, "Kevlar aramid fiber technical guide",
/// Kevlar 29). The drag is that of a smooth cylinder with a friction coefficient of 0.01, drawn along its axis at 0.2
/// m/s.
struct Cable {
    name: &'static str,
    diameter_m: f64,
    strength_n: f64,
}

const CABLES: [Cable; 1] = [Cable { name: "fathom", diameter_m: 0.0076, strength_n: 1557.0 }];
const ARAMID_STRAIN: f64 = 0.036;
const FRICTION: f64 = 0.01;
const DRAWN_MPS: f64 = 0.2;
/// Distance on either side of an opening within which the opening's corners cause double reflections, m.
const BESIDE_M: f64 = 1.0;
/// Length over which the end of a steel lining disturbs a compass, m, and the largest disturbance there, degrees. Both
/// values are from the scene steel.toml.
const STEEL_END_M: f64 = 6.0;
const STEEL_END_DEG: f64 = 10.0;

/// The descriptions in a scene that imply effects.
#[derive(Debug, Clone, Default)]
pub(crate) struct Described {
    temperature_degc: Option<f64>,
    per_metre_degc: Option<f64>,
    murk: Vec<Murk>,
    leaks: Vec<Leak>,
    linings: Vec<(Stretch, Lining)>,
    cable: Option<CableKeys>,
    thrusters: Option<Thrusters>,
}

/// Silt in the tunnel's water.
#[derive(Debug, Clone, Copy)]
struct Murk {
    stretch: Stretch,
    silt_gpl: f64,
    grain_um: f64,
}

/// A leak: a flow out of the tunnel if `flow_m3ps` is positive, or into the tunnel if it is negative.
#[derive(Debug, Clone, Copy)]
struct Leak {
    chainage_m: f64,
    flow_m3ps: f64,
    /// Whether the water of the leak comes from the portal rather than from the far end of the tunnel.
    from_portal: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Lining {
    Rock,
    Concrete,
    Steel,
}

#[derive(Debug, Clone, Copy)]
struct CableKeys {
    kind: Option<usize>,
    slack_m: Option<f64>,
    wound_by_m: Option<f64>,
    wheel_share: Option<f64>,
}

#[derive(Debug, Clone, Copy)]
struct Thrusters {
    rpm: f64,
    blades: f64,
    accel_mps2: f64,
}

/// The scene's tables with descriptions that imply effects.
pub(crate) struct Tables<'a> {
    water: Option<Section<'a>>,
    stretches: Vec<Section<'a>>,
    cable: Option<Section<'a>>,
    thrusters: Option<Section<'a>>,
}

impl<'a> Tables<'a> {
    /// Finds the tables `[water]`, `[cable]` and `[thrusters]`, and the stretches in `[tunnel]`.
    ///
    /// Errors: one of these keys is not a table.
    pub(crate) fn of(root: &Section<'a>, tunnel: Option<&Section<'a>>) -> Result<Self, ConfigError> {
        let stretches = tunnel.map(|tunnel| tunnel.sections("stretches")).transpose()?;
        Ok(Self {
            water: root.section("water")?,
            stretches: stretches.unwrap_or_default(),
            cable: root.section("cable")?,
            thrusters: root.section("thrusters")?,
        })
    }
}

impl Described {
    /// Reads the tables of a scene whose tunnel is `length_m` long.
    ///
    /// Errors: a key is missing, unknown or out of range, or linings overlap.
    pub(crate) fn read(tables: Tables<'_>, length_m: f64) -> Result<Self, ConfigError> {
        let mut described = Self::default();
        if let Some(water) = tables.water {
            described.water(&water, length_m)?;
        }
        for table in tables.stretches {
            described.lining(&table, length_m)?;
        }
        described.cable = tables.cable.map(|table| CableKeys::read(&table)).transpose()?;
        described.thrusters = tables.thrusters.map(|table| Thrusters::read(&table)).transpose()?;
        Ok(described)
    }

    fn lining(&mut self, table: &Section<'_>, length_m: f64) -> Result<(), ConfigError> {
        let words = [("rock", Lining::Rock), ("concrete", Lining::Concrete), ("steel", Lining::Steel)];
        let lining = table.required("lining", table.choice("lining", &words)?)?;
        let stretch = within(table, length_m)?;
        if self.linings.iter().any(|(other, _)| other.meets(&stretch)) {
            return Err(table.invalid("from_m", "begins a stretch that overlaps an earlier one"));
        }
        self.linings.push((stretch, lining));
        table.finish()
    }

    fn water(&mut self, water: &Section<'_>, length_m: f64) -> Result<(), ConfigError> {
        self.temperature_degc = water.number("temperature_degc", 0.0..=40.0)?;
        self.per_metre_degc = water.number("warmer_per_metre_degc", -5.0..=5.0)?;
        if self.per_metre_degc.is_some() && self.temperature_degc.is_none() {
            let problem = "needs temperature_degc, the temperature of the water at the floor";
            return Err(water.invalid("warmer_per_metre_degc", problem));
        }
        for table in water.sections("murk")? {
            let silt_gpl = table.required("silt_gpl", table.number("silt_gpl", 0.001..=100.0)?)?;
            let grain_um = table.number("grain_um", 0.5..=100.0)?.unwrap_or(10.0);
            let stretch = within(&table, length_m)?;
            table.finish()?;
            self.murk.push(Murk { stretch, silt_gpl, grain_um });
        }
        for table in water.sections("leaks")? {
            let chainage_m = table.required("chainage_m", table.number("chainage_m", 0.0..=length_m)?)?;
            let flow_m3ps = table.required("flow_m3ps", table.number("flow_m3ps", -100.0..=100.0)?)?;
            let sides = [("portal", true), ("far_end", false)];
            let from_portal = table.choice("fed_from", &sides)?.unwrap_or(false);
            table.finish()?;
            self.leaks.push(Leak { chainage_m, flow_m3ps, from_portal });
        }
        water.finish()
    }

    /// The effects that all descriptions of the scene imply.
    pub(super) fn calls(&self, site: &Site, facts: &Facts, environment: &Environment) -> Vec<Call> {
        let of = |sense: Sense| {
            let sensors = facts.sensors.iter().filter(|sensor| sensor.sense == sense);
            sensors.map(|sensor| sensor.id.clone()).collect::<Vec<_>>()
        };
        let [heads, units, counters] = [Sense::Head, Sense::Inertial, Sense::Tether].map(of);
        let sonars = [heads.clone(), of(Sense::Echosounder)].concat();
        let mut calls = Vec::new();
        if !sonars.is_empty() {
            calls.extend(self.of_water(site, &heads, &sonars));
            calls.extend(openings(environment, &sonars, facts.length_m));
            calls.extend(rubble(environment, &sonars));
        }
        calls.extend(self.of_leaks(facts, environment));
        self.linings.iter().for_each(|(stretch, lining)| {
            lining.call(*stretch, [&heads, &sonars, &units], &mut calls);
        });
        if let (Some(cable), false) = (&self.cable, counters.is_empty()) {
            calls.extend(cable.calls().into_iter().map(|call| call.on(&counters)));
        }
        if let (Some(thrusters), false) = (&self.thrusters, units.is_empty()) {
            calls.push(thrusters.call().on(&units));
        }
        calls
    }

    fn of_water(&self, site: &Site, heads: &[String], sonars: &[String]) -> Vec<Call> {
        let mut calls = Vec::new();
        if let Some(degc) = self.temperature_degc {
            let by = format!("water at {degc} degrees C");
            if !heads.is_empty() {
                let keys = [("temperature_degc", number(degc))];
                calls.push(Call::new("echo_strength", by.clone(), &keys).on(heads));
            }
            let pressure_pa = site.pressure_pa(site.surface_above_floor_m);
            let speed_mps = |degc| fresh_water_sound_speed_mps(degc, pressure_pa);
            let per_metre = self.per_metre_degc.unwrap_or(0.0);
            let per_metre_mps = speed_mps(degc + per_metre) - speed_mps(degc);
            let keys = [("floor_mps", number(speed_mps(degc))), ("per_metre_mps", number(per_metre_mps))];
            calls.push(Call::new("sound_speed_profile", by, &keys).on(sonars));
        }
        for murk in &self.murk {
            let place_m = [murk.stretch.from_m, murk.stretch.to_m];
            let by = format!("murk of {} g/l from {} to {} m", murk.silt_gpl, place_m[0], place_m[1]);
            let call = |effect, keys: &[_]| Call::new(effect, by.clone(), keys).within(place_m);
            // Values from docs/why/field.md, "murk", for runs of lost returns, near returns (5 %) and second echoes.
            let lost = [("share", number(0.2)), ("mean_run", number(6.0))];
            let near = [("share", number(0.05)), ("mean_run", number(3.0))];
            let silt = [("silt_gpl", number(murk.silt_gpl)), ("grain_um", number(murk.grain_um))];
            if !heads.is_empty() {
                calls.push(call("echo_strength", &silt).on(heads));
            }
            calls.push(call("missing_returns", &lost).on(sonars));
            calls.push(call("near_returns", &near).on(sonars));
            calls.push(call("multipath", &[("share", number(0.1))]).on(sonars));
        }
        calls
    }

    fn of_leaks(&self, facts: &Facts, environment: &Environment) -> Vec<Call> {
        // If the trajectory is given over ground, a current does not carry the vehicle.
        if self.leaks.is_empty() || facts.ground == Ground::Tunnel {
            return Vec::new();
        }
        let area_m2 = environment.area_m2();
        let leak = |leak: &Leak| {
            let Leak { chainage_m, flow_m3ps, from_portal } = *leak;
            let by = format!("a leak of {flow_m3ps} m3/s at {chainage_m} m");
            let (towards, place_m) =
                if from_portal { (1.0, [0.0, chainage_m]) } else { (-1.0, [chainage_m, facts.length_m]) };
            let keys = [("speed_mps", number(towards * flow_m3ps / area_m2))];
            (place_m[1] > place_m[0]).then(|| Call::new("current", by, &keys).within(place_m))
        };
        self.leaks.iter().filter_map(leak).collect()
    }
}

/// Reads the required keys `from_m` and `to_m` of a stretch.
fn within(table: &Section<'_>, length_m: f64) -> Result<Stretch, ConfigError> {
    let stretch = Stretch::read(table, length_m)?;
    for (key, end_m) in [("from_m", stretch.from_m), ("to_m", stretch.to_m)] {
        table.required(key, end_m.is_finite().then_some(()))?;
    }
    Ok(stretch)
}

/// Effects for double reflections at the corners of openings.
fn openings(environment: &Environment, sonars: &[String], length_m: f64) -> Vec<Call> {
    let by_opening = |(name, [from_m, to_m]): (&str, [f64; 2])| {
        let place_m = [(from_m - BESIDE_M).max(0.0), (to_m + BESIDE_M).min(length_m)];
        let by = format!("{name} from {from_m:.1} to {to_m:.1} m");
        Call::new("multipath", by, &[("share", number(0.1))]).on(sonars).within(place_m)
    };
    environment.openings().map(by_opening).collect()
}

/// Effect of rubble: a wide beam hits both stones and the wall behind them.
fn rubble(environment: &Environment, sonars: &[String]) -> Option<Call> {
    let [from_m, to_m] = environment.rubble_m()?;
    let by = format!("rubble from {from_m:.1} to {to_m:.1} m");
    Some(Call::new("beam_cone", by, &[]).on(sonars))
}

impl Lining {
    /// Adds the effects of a lining.
    ///
    /// A smooth wall returns little sound except at perpendicular incidence, and more sound by indirect paths. The ends
    /// of a steel lining disturb compasses. The shares are from the scene steel.toml. The backscatter relative to rough
    /// rock is from Urick, "Principles of underwater sound", ch. 8 (smooth bottoms are 10 to 20 dB below rock).
    fn call(self, stretch: Stretch, [heads, sonars, units]: [&[String]; 3], calls: &mut Vec<Call>) {
        let (name, wall_db, share) = match self {
            Self::Rock => return,
            Self::Concrete => ("concrete", -5.0, 0.05),
            Self::Steel => ("steel", -10.0, 0.15),
        };
        let Stretch { from_m, to_m } = stretch;
        let by = format!("a lining of {name} from {from_m} to {to_m} m");
        let call = |effect, keys: &[_]| Call::new(effect, by.clone(), keys).within([from_m, to_m]);
        if !heads.is_empty() {
            calls.push(call("echo_strength", &[("wall_db", number(wall_db))]).on(heads));
        }
        if !sonars.is_empty() {
            calls.push(call("multipath", &[("share", number(share))]).on(sonars));
            calls.push(call("side_lobes", &[("share", number(share / 3.0))]).on(sonars));
        }
        if self == Self::Steel && !units.is_empty() {
            let end = |chainage_m: f64, deg: f64| {
                format!("{{ chainage_m = {chainage_m:?}, length_m = {STEEL_END_M:?}, deg = {deg:?} }}")
            };
            let ends = [end(from_m, STEEL_END_DEG), end(to_m, -STEEL_END_DEG)].join(", ");
            let keys = [("places", format!("[{ends}]"))];
            calls.push(Call::new("magnetic_disturbance", by.clone(), &keys).on(units));
        }
    }
}

impl CableKeys {
    fn read(table: &Section<'_>) -> Result<Self, ConfigError> {
        let names: Vec<(&str, usize)> = CABLES.iter().enumerate().map(|(k, cable)| (cable.name, k)).collect();
        let keys = Self {
            kind: table.choice("type", &names)?,
            slack_m: table.number("slack_m", 0.001..=50.0)?,
            wound_by_m: table.number("wound_by_m", 0.01..=50.0)?,
            wheel_share: table.number("wheel_share", -0.1..=0.1)?,
        };
        table.finish()?;
        Ok(keys)
    }

    fn calls(&self) -> Vec<Call> {
        let mut calls = Vec::new();
        if let Some(cable) = self.kind.and_then(|kind| CABLES.get(kind)) {
            let area_m2pm = math::TAU / 2.0 * cable.diameter_m;
            let drag_npm = 0.5 * 1000.0 * area_m2pm * FRICTION * DRAWN_MPS * DRAWN_MPS;
            let stiffness_n = cable.strength_n / ARAMID_STRAIN;
            let keys = [("stiffness_n", number(stiffness_n)), ("drag_npm", number(drag_npm))];
            calls.push(Call::new("tether_scale", format!("a cable of type {}", cable.name), &keys));
        }
        if let Some(share) = self.wheel_share.filter(|share| *share != 0.0) {
            let by = format!("a counter wheel with a scale error of {share}");
            calls.push(Call::new("tether_scale", by, &[("share", number(share))]));
        }
        if let Some(slack_m) = self.slack_m {
            let by = format!("a cable that hangs loose by {slack_m} m");
            calls.push(Call::new("tether_slack", by, &[("reach_m", number(slack_m))]));
        }
        if let Some(hold_m) = self.wound_by_m {
            let by = format!("a cable wound {hold_m} m at a time");
            calls.push(Call::new("late_winding", by, &[("hold_m", number(hold_m))]));
        }
        calls
    }
}

impl Thrusters {
    fn read(table: &Section<'_>) -> Result<Self, ConfigError> {
        let rpm = table.number("rpm", 60.0..=6000.0)?;
        let blades = table.number("blades", 1.0..=8.0)?.unwrap_or(3.0);
        let accel_mps2 = table.number("accel_mps2", 0.001..=100.0)?;
        table.finish()?;
        let (rpm, accel_mps2) = (table.required("rpm", rpm)?, table.required("accel_mps2", accel_mps2)?);
        Ok(Self { rpm, blades, accel_mps2 })
    }

    fn call(&self) -> Call {
        let Self { rpm, blades, accel_mps2 } = *self;
        let by = format!("thrusters of {blades} blades at {rpm} turns a minute");
        let keys = [("frequency_hz", number(rpm / 60.0 * blades)), ("accel_mps2", number(accel_mps2))];
        Call::new("imu_vibration", by, &keys)
    }
}
