//! Cells of the field table: the scenes that are simulated, and the vehicle files that headrace reads.

use std::fmt::Write as _;

use headrace_geometry::math;
use headrace_sampling::plan::HELD_SHARE;
use headrace_sensor::device::Sense;
use headrace_simulator::Scene;
use headrace_vehicle::VehicleConfig;

use super::breaking::DeviceFault;
use crate::planned::planned_mps;
use crate::random_dives::Draw;
use crate::scenes;

/// A vehicle of the field table.
#[derive(Debug, Clone, Copy)]
pub struct Vehicle {
    /// Name of the vehicle in the field table.
    pub name: &'static str,
    /// File name in `deploy/vehicles`.
    pub file: &'static str,
    /// Mode of the heads, such as "fast".
    pub mode: &'static str,
    /// Target T, m.
    pub target_m: f64,
    /// Layout of the heads: phase shift or sectors.
    pub layout: &'static str,
    /// Default length of a dive, m. It is larger for vehicles whose passes are far apart.
    pub length_m: f64,
    /// Factor by which the chainages of [`PLACES`] are multiplied, except the place near the portal. It is 1 in a
    /// tunnel of 7 km.
    pub far_share: f64,
    /// Noise of the inertial unit, unless a condition changes it.
    unit: Unit,
    /// Largest speed that meets the target by the paper's Eq. 16, reduced only for the vehicle's own occlusion, m/s.
    /// The value is a constant, so that speeds derived from it don't depend on the planner.
    pub edge_mps: f64,
}

/// Inertial units, named by the source of their simulated noise: a vehicle file or a data sheet.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Unit {
    /// An inertial unit with the noise of the preset `xsens_mti600`, from `plugins/imu_can/src/noise.rs`.
    Xsens,
    /// An autopilot's inertial unit. Its noise equals the defaults of `[navigation]`.
    Autopilot,
}

/// All vehicles of the field table.
pub const VEHICLES: [Vehicle; 8] = [
    vehicle("vita1", "vita1.toml", "slow", 5.0, 45.0, 0.231),
    vehicle("vita2-2", "vita2-2.toml", "fast", 0.5, 15.0, 0.115),
    vehicle("vita2-3", "vita2-3.toml", "fast", 0.5, 15.0, 0.089),
    vehicle("vita2-4", "vita2-4.toml", "fast", 0.5, 15.0, 0.118),
    Vehicle {
        layout: "sector_offset",
        ..vehicle("vita2-4-sectors", "vita2-4.toml", "fast", 0.5, 15.0, 0.099)
    },
    Vehicle { far_share: 0.05, ..vehicle("pipe", "pipe.toml", "fast", 0.5, 10.0, 0.116) },
    Vehicle { unit: Unit::Autopilot, ..vehicle("autopilot", "autopilot.toml", "fast", 0.5, 15.0, 0.118) },
    Vehicle {
        unit: Unit::Autopilot,
        far_share: 0.16,
        ..vehicle("bluerov2", "bluerov2.toml", "fast", 1.0, 20.0, 0.186)
    },
];

const fn vehicle(
    name: &'static str,
    file: &'static str,
    mode: &'static str,
    target_m: f64,
    length_m: f64,
    edge_mps: f64,
) -> Vehicle {
    let (layout, far_share, unit) = ("phase_shift", 1.0, Unit::Xsens);
    Vehicle { name, file, mode, target_m, layout, length_m, far_share, unit, edge_mps }
}

/// Condition of a dive: sensor errors, wall and driving.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Condition {
    /// No effects other than motion and the vehicle's own occlusion.
    Clean,
    /// Every sensor has the noise of its data sheet.
    DataSheet,
    /// As `DataSheet`, but the vehicle file states the true sensor noises. The file makes no allowance for rough walls,
    /// tilt or cable slack.
    Declared,
    /// A MEMS inertial unit and cable slack, both stated in the vehicle file. The cable counter has an error of 0.5 %,
    /// and steel is nearby.
    Poor,
    /// Several lost returns in a row, returns from objects in front of the wall, and second echoes.
    Murk,
    /// Objects in front of the wall, and several second echoes in a row.
    Fish,
    /// The wall is as rough as vehicle files allow for.
    Rough,
    /// The wall deviates from the design by some centimetres, inwards and outwards.
    AsBuilt,
    /// On a stretch, the wall is wider by 5 or 10 %, or has a ditch, or has a side tunnel that the vehicle file doesn't
    /// declare.
    Altered,
    /// A pilot who wanders, stops and turns back.
    Lively,
    /// The speed of sound in the water is 4 % above the value in the vehicle file.
    WrongSound,
    /// The mounts of all heads differ by 0.3 degrees (standard deviation) from the vehicle file, which declares this
    /// error.
    Mounts,
    /// The mount of a head differs by 3 degrees from the vehicle file.
    WrongMount,
    /// The wall is 6 % wider than in the vehicle file.
    WrongWall,
    /// The data of a sensor arrive 0.3 s late.
    WrongLatency,
    /// The cable counter reads 2 % too much.
    WrongCable,
    /// The inertial unit is a MEMS unit, but the vehicle file names a better unit.
    WrongUnit,
    /// The cable hangs, but the vehicle file states that it is taut.
    WrongSlack,
    /// One device gets stuck, jumps, dies, dies and returns, or babbles.
    Broken,
}

/// All conditions with the names that the table uses.
pub const CONDITIONS: [(&str, Condition); 19] = [
    ("clean", Condition::Clean),
    ("data-sheet", Condition::DataSheet),
    ("told", Condition::Declared),
    ("poor", Condition::Poor),
    ("murk", Condition::Murk),
    ("fish", Condition::Fish),
    ("rough", Condition::Rough),
    ("as-built", Condition::AsBuilt),
    ("altered", Condition::Altered),
    ("lively", Condition::Lively),
    ("wrong-sound", Condition::WrongSound),
    ("mounts", Condition::Mounts),
    ("wrong-mount", Condition::WrongMount),
    ("wrong-wall", Condition::WrongWall),
    ("wrong-latency", Condition::WrongLatency),
    ("wrong-cable", Condition::WrongCable),
    ("wrong-unit", Condition::WrongUnit),
    ("wrong-slack", Condition::WrongSlack),
    ("broken", Condition::Broken),
];

/// Place at which a dive starts: name, and chainage in m.
pub type Place = (&'static str, f64);

/// Places at which dives start. In tunnels shorter than 7 km, the chainages are reduced ([`Vehicle::far_share`]).
pub const PLACES: [Place; 3] = [("portal", 3.0), ("3000", 3000.0), ("6900", 6900.0)];

/// Speed and manner in which the pilot drives during a dive.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Driven {
    /// At the speed that `plan --write` gives for the cell's mode and target.
    Planned,
    /// At the planned speed, after a stationary phase at the start.
    Stood,
    /// At the planned speed, after driving slowly to the start while swinging left and right.
    Swung,
    /// At the given multiple of the largest speed by the paper's Eq. 16, with the heads in phase for the planned speed.
    Times(f64),
    /// By a pilot who never goes back. He follows the live advice within 5 %, with a delay of 3 s.
    Advised,
    /// By a pilot who drives at 1.2 times the largest speed by the paper's Eq. 16, and afterwards goes back for every
    /// missed section.
    Back,
}

/// All kinds of driving with the names that the table uses.
pub const DRIVEN: [(&str, Driven); 6] = [
    ("planned", Driven::Planned),
    ("stood", Driven::Stood),
    ("swung", Driven::Swung),
    ("faster", Driven::Times(1.2)),
    ("advised", Driven::Advised),
    ("back", Driven::Back),
];

/// A cell of the field table.
#[derive(Debug, Clone, Copy)]
pub struct Cell {
    /// Vehicle of the cell.
    pub vehicle: Vehicle,
    /// Condition of the cell: sensor errors, wall and driving.
    pub condition: Condition,
    /// Chainage at which the dive starts, m.
    pub start_m: f64,
    /// Chainage at which the vehicle is launched, m, if it differs from `start_m`. The vehicle then drives to
    /// `start_m`.
    pub let_in_m: Option<f64>,
    /// Speed and manner of driving.
    pub driven: Driven,
}

/// A dive of a cell: the simulated scene, and the vehicle file that headrace reads.
pub struct CellDive {
    /// The simulated scene.
    pub scene: Scene,
    /// The same scene, but with the vehicle file that headrace reads.
    pub believed: Scene,
}

/// Noise and resolution of the depth sensor. Heads and echosounders have tables of their own. Source:
/// `replay/simulator/src/implied_effects/data_sheets.rs`.
const DEPTH: &str = "depth_steps = {}\ndepth_noise = { noise_pa = 152 }\n";
/// Noise and biases of the inertial units. Source: `plugins/imu_can/src/noise.rs`, and the defaults of `[navigation]`
/// in docs/reference/vehicle-file.md.
const XSENS: &str = "imu_noise = { gyro_degps_rthz = 0.0077, accel_mps2_rthz = 0.0006, attitude_deg = 0.3 }\n\
     imu_bias = { gyro_degps = 0.0022, accel_mps2 = 0.002, tau_s = 300, gyro_constant_degps = 0.05, accel_constant_mps2 = 0.02 }\n";
const AUTOPILOT: &str = "imu_noise = { gyro_degps_rthz = 0.01, accel_mps2_rthz = 0.003, attitude_deg = 0.3 }\n\
     imu_bias = { gyro_degps = 0.2, accel_mps2 = 0.03, tau_s = 1000 }\n";
/// Noise and biases of the MEMS inertial unit. Source: field.md, "poor".
const MEMS: &str = "imu_noise = { gyro_degps_rthz = 0.007, accel_mps2_rthz = 0.001, attitude_deg = 0.3 }\n\
     imu_bias = { gyro_degps = 0.2, accel_mps2 = 0.02, tau_s = 300 }\n";
/// Settings of the vehicle file for the MEMS inertial unit.
const MEMS_TOLD: &str = "gyro_noise_degps_rthz = 0.007\naccel_noise_mps2_rthz = 0.001\ngyro_bias_degps = 0.2\n\
     gyro_bias_time_s = 300\naccel_bias_mps2 = 0.02\naccel_bias_time_s = 300\n";
const STEEL: &str = "magnetic_disturbance = { per_100m = 4, up_to_deg = 10, length_m = 6 }\n";
const SLACK: &str = "tether_slack = { reach_m = 0.15, period_s = 30 }\n";
/// Cable slack settings of the vehicle file for a taut cable. `HANGS` has the settings for a hanging cable.
const TAUT: &str = "slack_sd_m = 0.003\nslack_time_s = 10\n";
const MOUNTS: &str = "mount_sd_deg = 0.3\n";
const HANGS: &str = "slack_sd_m = 0.06\nslack_time_s = 10\n";

/// Settings of the vehicle file that state the noises of the `DataSheet` effects.
///
/// The settings cover heads (resolution 2 cm, noise 1 cm, range 10 m), echosounders, depth (152 Pa) and attitudes. The
/// cable and its scale have almost no noise. The noise of the inertial unit comes from the unit's preset.
const TRUE_NOISES: &str = "return_sd_m = 0.0116\necho_sd_m = 0.02\ndepth_sd_m = 0.0155\ntilt_sd_deg = 0.3\nattitude_sd_deg = 0.3\n\
     heading_sd_deg = 0.3\ndeviation_deg = 0.01\ntether_sd_m = 0.0001\nslack_sd_m = 0.0001\nslack_time_s = 10\ntether_scale_sd = 0.00001\n";

/// Standard deviation of the roughness of a wall, m. Roughness and noise of the heads together give the 3 cm that
/// vehicle files allow for.
const ROUGH_M: f64 = 0.028;

/// Largest deviation of the wall from the design, m: the sum of several lining tolerances.
const OFF_DESIGN_M: f64 = 0.06;

/// Duration of the stationary phase at the start of a dive, s.
const STANDS_S: f64 = 30.0;

/// Speed of a vehicle that swings, m/s.
const SWINGING_MPS: f64 = 0.05;
/// Swings before a dive: number of swings, duration of each swing in seconds, and angle in degrees.
const SWINGS: (u32, f64, f64) = (12, 10.0, 5.0);

/// Speed of the vehicle from the launch to the start of the inspection, m/s.
const WAY_MPS: f64 = 0.3;

impl Cell {
    /// The dive that belongs to `seed`, with a length of `length_m`.
    pub fn dive(&self, seed: u64, length_m: f64) -> CellDive {
        let plain = self.plain(seed, length_m);
        let [planned_mps, speed_mps] = self.speeds_mps(&plain.vehicle);
        let declared = self.declared().replace("PLANNED", &format!("{planned_mps:.4}"));
        let effects = self.effects(&plain, seed, length_m, length_m / speed_mps);
        let truly = self.truly(&declared, &plain, seed);
        let text = self.text(seed, length_m, speed_mps, &effects);
        CellDive { scene: parse(&text, &truly, seed), believed: parse(&text, &declared, seed) }
    }

    /// Ratio of the planned speed to the largest speed by the paper's Eq. 16.
    pub fn plan_share(&self) -> f64 {
        self.plan_mps(&self.plain(1, 1.0).vehicle) / self.vehicle.edge_mps
    }

    /// The device that is broken in the dive with the seed `seed` and the length `length_m`, and its fault.
    pub fn broken(&self, seed: u64, length_m: f64) -> DeviceFault {
        let plain = self.plain(seed, length_m);
        let [_, speed_mps] = self.speeds_mps(&plain.vehicle);
        DeviceFault::of(seed, &plain, length_m / speed_mps)
    }

    /// The scene of a dive without effects. Its speed has no meaning.
    fn plain(&self, seed: u64, length_m: f64) -> Scene {
        parse(&self.text(seed, length_m, 0.1, ""), &self.declared(), seed)
    }

    /// Text of the vehicle file that headrace reads, with a placeholder for the planned speed.
    fn declared(&self) -> String {
        let Vehicle { file, mode, target_m, layout, .. } = self.vehicle;
        let text = String::from_utf8(scenes::vehicle_file(file).unwrap()).unwrap();
        let lines = text.lines().map(|line| match line.split(" =").next() {
            Some("target_m") => format!("target_m = {target_m:?}"),
            Some("mode") => format!("mode = {mode:?}"),
            Some("layout") => format!("layout = {layout:?}"),
            Some("planned_speed_mps") => "planned_speed_mps = PLANNED".to_owned(),
            Some("[navigation]" | "slack_sd_m" | "slack_time_s" | "mount_sd_deg") => String::new(),
            _ => line.to_owned(),
        });
        let declared = lines.collect::<Vec<_>>().join("\n");
        declared.replace("[heads]", &format!("[navigation]\n{}\n[heads]", self.declared_navigation()))
    }

    /// Navigation settings of the vehicle file that headrace reads. In most conditions they state only the slack of a
    /// taut cable. In some conditions they also state noises or mount errors.
    fn declared_navigation(&self) -> String {
        match self.condition {
            Condition::Poor => format!("{HANGS}{MEMS_TOLD}"),
            Condition::Declared => TRUE_NOISES.to_owned(),
            Condition::Mounts | Condition::WrongMount => format!("{TAUT}{MOUNTS}"),
            _ => TAUT.to_owned(),
        }
    }

    /// The vehicle file of the simulated vehicle, which may differ from the file `declared` that headrace reads.
    fn truly(&self, declared: &str, plain: &Scene, seed: u64) -> String {
        let counts = |by: f64| {
            let count = 2000.0 * by;
            declared.replace("counts_per_metre = 2000", &format!("counts_per_metre = {count:.1}"))
        };
        match self.condition {
            // A cable counter that reads too little keeps estimated chainages within the tunnel. A counter that reads
            // too much could put them beyond the tunnel's end.
            Condition::Poor => counts(0.995),
            Condition::WrongCable => counts(0.98),
            Condition::WrongMount => {
                let heads = of_sense(plain, Sense::Head);
                turned(declared, &heads[Draw::new(seed).below(heads.len())])
            }
            _ => declared.to_owned(),
        }
    }

    /// Planned speed, and speed at which the pilot drives, m/s.
    fn speeds_mps(&self, vehicle: &VehicleConfig) -> [f64; 2] {
        let planned_mps = HELD_SHARE * self.plan_mps(vehicle);
        match self.driven {
            Driven::Planned | Driven::Stood | Driven::Swung => [planned_mps, planned_mps],
            Driven::Times(times) => [planned_mps, times * self.vehicle.edge_mps],
            // A pilot who follows advice has no fixed speed. For `Advised` and `Back`, the second value is the largest
            // speed that the pilot may drive.
            Driven::Advised | Driven::Back => [planned_mps, 1.2 * self.vehicle.edge_mps],
        }
    }

    /// Planned speed from `plan`, m/s.
    fn plan_mps(&self, vehicle: &VehicleConfig) -> f64 {
        planned_mps(vehicle, &self.declared().replace("PLANNED", "0.1"), self.vehicle.mode)
    }

    fn text(&self, seed: u64, length_m: f64, speed_mps: f64, effects: &str) -> String {
        let start_m = self.start_m;
        let to_m = start_m + length_m;
        let way = if matches!(self.driven, Driven::Advised | Driven::Back) {
            let hurries = format!(
                "[[trajectory.hurries]]\nfrom_m = {start_m}\nto_m = {to_m}\nspeed_mps = {speed_mps}\n"
            );
            let lively = self.condition == Condition::Lively;
            let [aside_m, up_m] = [1.0, 0.5].map(|most_m| if lively { self.aside_m(most_m) } else { 0.0 });
            let [yaw_deg, tilt_deg] = if lively { [10, 2] } else { [0, 0] };
            format!(
                "kind = \"advised\"\nstart_m = {start_m}\nto_m = {to_m}\nspeed_mps = {speed_mps}\n\
                 goes_back = {}\nstands = true\nwander_across_m = {aside_m}\nwander_up_m = {up_m}\nwander_yaw_deg = {yaw_deg}\n\
                 wander_pitch_deg = {tilt_deg}\nwander_roll_deg = {tilt_deg}\n{}",
                self.driven == Driven::Back,
                if self.driven == Driven::Back { &hurries } else { "" },
            )
        } else if self.condition == Condition::Lively {
            format!(
                "kind = \"pilot\"\nstart_m = {start_m}\nto_m = {}\nspeed_mps = {speed_mps}\nstops_per_hour = 30\n\
                 stop_s = [5, 20]\nbacks_per_hour = 20\nback_m = [1, 3]\nwander_across_m = {}\nwander_up_m = {}\n\
                 wander_yaw_deg = 10\nwander_pitch_deg = 2\nwander_roll_deg = 2\n",
                to_m,
                self.aside_m(1.0),
                self.aside_m(0.5)
            )
        } else if matches!(self.driven, Driven::Stood | Driven::Swung) {
            let place = |chainage_m: f64, more: &str| {
                format!("[[trajectory.waypoints]]\nchainage_m = {chainage_m:.4}\n{more}\n")
            };
            let (swings, swing_s, yaw_deg) = SWINGS;
            let each_m = SWINGING_MPS * swing_s;
            let swings = if self.driven == Driven::Swung { swings } else { 0 };
            let mut from_m = (start_m - (f64::from(swings) + 0.5) * each_m).max(start_m.min(1.0));
            let mut way = place(from_m, &format!("stay_s = {STANDS_S}"));
            for swing in 0..swings {
                let yaw_deg = if swing % 2 == 0 { yaw_deg } else { -yaw_deg };
                from_m += each_m;
                way += &place(from_m, &format!("yaw_deg = {yaw_deg}\nspeed_mps = {SWINGING_MPS}"));
            }
            if swings > 0 {
                way += &place(from_m + each_m / 2.0, &format!("speed_mps = {SWINGING_MPS}"));
            }
            way += &place(to_m, &format!("speed_mps = {speed_mps}"));
            format!("kind = \"waypoints\"\n{way}")
        } else {
            let leg = |distance_m: f64, speed_mps: f64| {
                format!("[[trajectory.legs]]\ndistance_m = {distance_m}\nspeed_mps = {speed_mps}\n")
            };
            let way = self.let_in_m.map(|from_m| leg(start_m - from_m, WAY_MPS)).unwrap_or_default();
            format!("start_m = {}\n{way}{}", self.let_in_m.unwrap_or(start_m), leg(length_m, speed_mps))
        };
        let wider = "[[tunnel.stations]]\nchainage_m = 0\nscale = 1.06\n";
        let tunnel = if self.condition == Condition::WrongWall { wider } else { "" };
        let rough = match self.condition {
            Condition::Rough => format!("[[tunnel.rough]]\nsd_m = {ROUGH_M}\nseed = {seed}\n"),
            Condition::AsBuilt => self.as_built(seed, length_m),
            Condition::Altered => self.altered(seed, length_m),
            _ => String::new(),
        };
        format!(
            "seed = {seed}\nvehicle = \"vehicle.toml\"\n{tunnel}{rough}[trajectory]\n{way}[effects]\nmotion_within_turn = {{}}\n{effects}"
        )
    }

    /// Bulges and hollows at random places all around the wall, two per metre of tunnel.
    fn as_built(&self, seed: u64, length_m: f64) -> String {
        let most_m = self.aside_m(OFF_DESIGN_M);
        let mut draw = Draw::new(seed ^ 0xb17);
        let (from_m, to_m) = (self.start_m - 5.0, self.start_m + length_m + 5.0);
        let mut text = String::new();
        for _ in 0..math::round_to_i64(2.0 * (to_m - from_m)) {
            let [long_m, wide_m] = [draw.between(2.0, 6.0), self.aside_m(draw.between(1.0, 4.0))];
            // The limit keeps the bulge from beginning before the tunnel's start.
            let at_m = draw.between(from_m, to_m).max(0.1 + long_m / 2.0);
            let [depth_m, arc_m] = [draw.between(-most_m, most_m), self.aside_m(draw.between(0.0, 36.0))];
            writeln!(
                text,
                "[[tunnel.features]]\nkind = \"bulge\"\nchainage_m = {at_m:.2}\nlength_m = {long_m:.2}\n\
                 width_m = {wide_m:.2}\ndepth_m = {depth_m:.6}\narc_m = {arc_m:.2}"
            )
            .unwrap();
        }
        text
    }

    /// Another wall on the middle third of the dive: a wider wall, a wall with a ditch, or a wall with a side tunnel.
    /// Only tunnels with a floor have ditches and side tunnels.
    fn altered(&self, seed: u64, length_m: f64) -> String {
        let mut draw = Draw::new(seed ^ 0xa17e);
        let from_m = self.start_m + length_m / 3.0;
        let to_m = from_m + (length_m / 3.0).max(4.0);
        let kinds = if matches!(self.vehicle.name, "pipe" | "bluerov2") { 2 } else { 4 };
        let middle_m = f64::midpoint(from_m, to_m);
        match seed % kinds {
            2 => format!(
                "[[tunnel.features]]\nkind = \"rock_trap\"\nchainage_m = {middle_m:.2}\nlength_m = {:.2}\ndepth_m = 1.5\n",
                to_m - from_m
            ),
            3 => format!(
                "[[tunnel.features]]\nkind = \"side_tunnel\"\nchainage_m = {middle_m:.2}\nside = \"left\"\n\
                 width_m = 4\nheight_m = 4\nlength_m = 12\n"
            ),
            kind => {
                let (scale, edge_m) = (if kind == 0 { 1.05 } else { 1.1 }, draw.between(1.0, 3.0));
                let station = |chainage_m: f64, scale: f64| {
                    format!("[[tunnel.stations]]\nchainage_m = {chainage_m:.2}\nscale = {scale}\n")
                };
                let ends = [
                    (0.0, 1.0),
                    (from_m, 1.0),
                    (from_m + edge_m, scale),
                    (to_m, scale),
                    (to_m + edge_m, 1.0),
                ];
                ends.map(|(chainage_m, scale)| station(chainage_m, scale)).concat()
            }
        }
    }

    /// Reduces an offset from the centre line, m, if the vehicle is in a narrow pipe and must keep clear of its wall.
    fn aside_m(&self, most_m: f64) -> f64 {
        if self.vehicle.name == "pipe" { 0.3 * most_m } else { most_m }
    }

    fn effects(&self, plain: &Scene, seed: u64, length_m: f64, duration_s: f64) -> String {
        let heads = of_sense(plain, Sense::Head);
        let occlusion = "occlusion = {}\n";
        if self.condition == Condition::Clean {
            return occlusion.to_owned();
        }
        let (heads, pings) = (quoted(&heads), quoted(&of_sense(plain, Sense::Echosounder)));
        let tables = format!(
            "[effects.beam_cone]\nsensors = {heads}\n\
             [effects.range_quantisation]\npoints = 500\nsensors = {heads}\n\
             [[effects.range_noise]]\nsd_m = 0.01\nsensors = {heads}\n\
             [[effects.range_noise]]\nsd_m = 0.02\nsensors = {pings}\n\
             [[effects.outliers]]\nshare = 0.08\nsensors = {pings}\n\
             [[effects.missing_returns]]\nshare = 0.05\nmean_run = 8\nsensors = {pings}\n"
        );
        format!(
            "{occlusion}{DEPTH}{}{tables}{}{}{}",
            self.units_and_cables(),
            self.fish(&heads),
            self.murk(&heads, seed, length_m),
            self.wrong(plain, seed, duration_s)
        )
    }

    fn units_and_cables(&self) -> String {
        let own = match self.vehicle.unit {
            Unit::Xsens => XSENS,
            Unit::Autopilot => AUTOPILOT,
        };
        match self.condition {
            Condition::Poor => format!("{MEMS}{STEEL}{SLACK}"),
            Condition::WrongUnit => MEMS.to_owned(),
            Condition::WrongSlack => format!("{own}{SLACK}"),
            _ => own.to_owned(),
        }
    }

    /// Clusters of returns in front of the wall, and several second echoes in a row.
    fn fish(&self, heads: &str) -> String {
        if self.condition != Condition::Fish {
            return String::new();
        }
        let far_m = self.aside_m(3.0);
        format!(
            "[effects.near_returns]\nshare = 0.01\nmean_run = 6\nnear_m = {}\nfar_m = {far_m}\nsensors = {heads}\n\
             [effects.multipath]\nshare = 0.05\nsquare_share = 0.01\nmean_run = 8\nsensors = {heads}\n",
            0.4 * far_m
        )
    }

    /// Murky stretches of 5 to 20 m length with gaps of 2 to 6 m.
    ///
    /// In these stretches, 10 to 30 % of the heads' returns are missing, several in a row. Clusters in front of the
    /// wall cause 5 % of the returns, and second echoes cause some more. Source: field.md, "murk".
    fn murk(&self, heads: &str, seed: u64, length_m: f64) -> String {
        if self.condition != Condition::Murk {
            return String::new();
        }
        let far_m = self.aside_m(3.0);
        let mut draw = Draw::new(seed ^ 0x5117);
        let (mut from_m, end_m) = (self.start_m + draw.between(2.0, 6.0), self.start_m + length_m);
        let mut murk = String::new();
        while from_m < end_m {
            let to_m = from_m + draw.between(5.0, 20.0);
            let place = format!("from_m = {from_m:.2}\nto_m = {to_m:.2}\nsensors = {heads}\n");
            let share = draw.between(0.1, 0.3);
            write!(
                murk,
                "[[effects.missing_returns]]\nshare = {share:.3}\nmean_run = 6\n{place}\
                 [[effects.near_returns]]\nshare = 0.05\nmean_run = 4\nnear_m = 0.6\nfar_m = {far_m}\n{place}\
                 [[effects.multipath]]\nshare = 0.1\n{place}"
            )
            .unwrap();
            from_m = to_m + draw.between(2.0, 6.0);
        }
        murk
    }

    /// Text of the simulator effect for the condition's single wrong setting or broken device.
    fn wrong(&self, plain: &Scene, seed: u64, duration_s: f64) -> String {
        let mut draw = Draw::new(seed);
        match self.condition {
            Condition::Mounts => {
                let heads = quoted(&of_sense(plain, Sense::Head));
                format!("[effects.mount_error]\nangles_sd_deg = 0.3\nsensors = {heads}\n")
            }
            Condition::WrongSound => "[effects.sound_speed_error]\nshare = 0.04\n".to_owned(),
            Condition::WrongLatency => {
                let sense = draw.one_of(&[Sense::Head, Sense::Inertial]);
                let late = quoted(&of_sense(plain, sense));
                format!("[effects.line_delay]\nlatency_ms = 300\nsensors = {late}\n")
            }
            Condition::Broken => DeviceFault::of(seed, plain, duration_s).effect(),
            _ => String::new(),
        }
    }
}

/// Ids of the sensors that measure this quantity (sense).
fn of_sense(scene: &Scene, sense: Sense) -> Vec<String> {
    scene
        .facts()
        .sensors
        .iter()
        .filter(|sensor| sensor.sense == sense)
        .map(|sensor| sensor.id.clone())
        .collect()
}

fn quoted(ids: &[String]) -> String {
    format!("{ids:?}")
}

/// Changes a vehicle file: turns one head by 3 degrees about the vertical.
fn turned(file: &str, head: &str) -> String {
    let mut within = false;
    let mut lines = Vec::new();
    for line in file.lines() {
        if line.starts_with("[[") {
            within = false;
        }
        if within && line.starts_with("angles_deg") {
            let yaw = if line.contains("180") { 183 } else { 3 };
            lines.push(format!("angles_deg = [0, 0, {yaw}]"));
            within = false;
            continue;
        }
        lines.push(line.to_owned());
        within |= line == format!("id = {head:?}");
    }
    let text = lines.join("\n");
    if text == file {
        file.replace(&format!("id = {head:?}"), &format!("id = {head:?}\nangles_deg = [0, 0, 3]"))
    } else {
        text
    }
}

fn parse(text: &str, vehicle: &str, seed: u64) -> Scene {
    let vehicle = vehicle.replace("PLANNED", "0.1");
    scenes::seeded(text, &|_| Ok(vehicle.clone().into_bytes()), Some(seed))
}
