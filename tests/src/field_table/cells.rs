//! What dives in each cell of the table: scenes, and the vehicle files that headrace is told.

use headrace_sensor::device::Sense;
use headrace_simulator::Scene;
use headrace_vehicle::VehicleConfig;

use super::breaking::Breakage;
use crate::planned::planned_mps;
use crate::random_dives::Draw;
use crate::scenes;

/// A vehicle of the table.
#[derive(Debug, Clone, Copy)]
pub struct Vehicle {
    /// Name in the table.
    pub name: &'static str,
    /// Its file in `deploy/vehicles`.
    pub file: &'static str,
    /// Mode of its heads.
    pub mode: &'static str,
    /// Target T, m.
    pub target_m: f64,
    /// Layout of its heads.
    pub layout: &'static str,
    /// Metres of a dive, unless told otherwise: more where passes are far apart.
    pub length_m: f64,
    /// The largest speed at which Eq. 16 keeps the target with what the vehicle hides, and no other margin, m/s. A number, so
    /// that speeds beyond it stay the same when plans change.
    pub edge_mps: f64,
}

/// The vehicles.
pub const VEHICLES: [Vehicle; 6] = [
    vehicle("vita1", "vita1.toml", "slow", 5.0, "phase_shift", 45.0, 0.231),
    vehicle("vita2-2", "vita2-2.toml", "fast", 0.5, "phase_shift", 15.0, 0.115),
    vehicle("vita2-3", "vita2-3.toml", "fast", 0.5, "phase_shift", 15.0, 0.089),
    vehicle("vita2-4", "vita2-4.toml", "fast", 0.5, "phase_shift", 15.0, 0.118),
    vehicle("vita2-4-sectors", "vita2-4.toml", "fast", 0.5, "sector_offset", 15.0, 0.099),
    vehicle("pipe", "pipe.toml", "fast", 0.5, "phase_shift", 10.0, 0.116),
];

const fn vehicle(
    name: &'static str,
    file: &'static str,
    mode: &'static str,
    target_m: f64,
    layout: &'static str,
    length_m: f64,
    edge_mps: f64,
) -> Vehicle {
    Vehicle { name, file, mode, target_m, layout, length_m, edge_mps }
}

/// What is the matter with a dive.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Condition {
    /// Nothing but motion and what the vehicle hides.
    Clean,
    /// Every sensor as its maker says.
    DataSheet,
    /// A MEMS unit, slack, a wheel 0.5 % off, steel.
    Poor,
    /// Returns lost in runs, near returns, second echoes.
    Murk,
    /// A pilot who wanders, stops and goes back.
    Lively,
    /// The water's speed of sound is 4 % more than the vehicle file says.
    WrongSound,
    /// A head is turned by 3 degrees from what the vehicle file says.
    WrongMount,
    /// The wall is 6 % wider than the vehicle file says.
    WrongWall,
    /// What a sensor says comes 0.3 s late.
    WrongLatency,
    /// The cable's counter counts 2 % too much.
    WrongCable,
    /// One device sticks, jumps, dies, returns or babbles.
    Broken,
}

/// All conditions with their names.
pub const CONDITIONS: [(&str, Condition); 11] = [
    ("clean", Condition::Clean),
    ("data-sheet", Condition::DataSheet),
    ("poor", Condition::Poor),
    ("murk", Condition::Murk),
    ("lively", Condition::Lively),
    ("wrong-sound", Condition::WrongSound),
    ("wrong-mount", Condition::WrongMount),
    ("wrong-wall", Condition::WrongWall),
    ("wrong-latency", Condition::WrongLatency),
    ("wrong-cable", Condition::WrongCable),
    ("broken", Condition::Broken),
];

/// Where dives begin: a name and a chainage, m.
pub type Place = (&'static str, f64);

/// The places. Of the pipe, which has 400 m, the last are 180 and 360 m.
pub const PLACES: [Place; 3] = [("portal", 3.0), ("3000", 3000.0), ("6900", 6900.0)];

/// How fast a vehicle goes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Driven {
    /// As planned: the vehicle file's speed, but no more than what `plan` says for mode and target.
    Planned,
    /// So many times the largest speed of Eq. 16, phases as planned.
    Times(f64),
    /// By a pilot who hears the live advice, follows it within 5 % and 3 s later, and never goes back.
    Advised,
    /// By one who is in a hurry all the way, 1.2 times the speed of Eq. 16, and then goes back for all that was missed.
    Back,
}

/// All with their names.
pub const DRIVEN: [(&str, Driven); 4] = [
    ("planned", Driven::Planned),
    ("faster", Driven::Times(1.2)),
    ("advised", Driven::Advised),
    ("back", Driven::Back),
];

/// A cell of the table.
#[derive(Debug, Clone, Copy)]
pub struct Cell {
    /// What dives.
    pub vehicle: Vehicle,
    /// What is the matter.
    pub condition: Condition,
    /// Where it begins, m.
    pub start_m: f64,
    /// How fast it goes.
    pub driven: Driven,
}

/// A dive of a cell: what is simulated, and what headrace is told.
pub struct CellDive {
    /// Simulated.
    pub scene: Scene,
    /// Has the vehicle file that headrace is told.
    pub believed: Scene,
}

/// Pings of an uncertain maker, and the depth and inertial units; heads have tables of their own.
const DATA_SHEET_SENSORS: &str = "imu_noise = { gyro_degps_rthz = 0.007, accel_mps2_rthz = 0.001, attitude_deg = 0.3 }\n\
     depth_steps = {}\n";
/// An MTi-class unit's biases.
const GOOD_BIAS: &str = "imu_bias = { gyro_degps = 0.003, accel_mps2 = 0.002, tau_s = 300 }\n";
const POOR_BIAS: &str = "imu_bias = { gyro_degps = 0.2, accel_mps2 = 0.02, tau_s = 300 }\n\
     magnetic_disturbance = { per_100m = 4, up_to_deg = 10, length_m = 6 }\n\
     tether_slack = { reach_m = 0.15, period_s = 30 }\n";

impl Cell {
    /// The dive of a seed over so many metres.
    pub fn dive(&self, seed: u64, length_m: f64) -> CellDive {
        let plain = self.plain(seed, length_m);
        let [planned_mps, speed_mps] = self.speeds_mps(&plain.vehicle);
        let told = self.told().replace("PLANNED", &format!("{planned_mps:.4}"));
        let effects = self.effects(&plain, seed, length_m / speed_mps);
        let truly = self.truly(&told, &plain, seed);
        let text = self.text(seed, length_m, speed_mps, &effects);
        CellDive { scene: parse(&text, &truly, seed), believed: parse(&text, &told, seed) }
    }

    /// The speed that `plan` says over that of Eq. 16.
    pub fn plan_share(&self) -> f64 {
        self.plan_mps(&self.plain(1, 1.0).vehicle) / self.vehicle.edge_mps
    }

    /// What breaks in the dive of a seed over so many metres.
    pub fn broken(&self, seed: u64, length_m: f64) -> Breakage {
        let plain = self.plain(seed, length_m);
        let [_, speed_mps] = self.speeds_mps(&plain.vehicle);
        Breakage::of(seed, &plain, length_m / speed_mps)
    }

    /// Without effects, at some speed.
    fn plain(&self, seed: u64, length_m: f64) -> Scene {
        parse(&self.text(seed, length_m, 0.1, ""), &self.told(), seed)
    }

    /// The vehicle file that headrace is told; the planned speed is yet to be filled in.
    fn told(&self) -> String {
        let Vehicle { file, mode, target_m, layout, .. } = self.vehicle;
        let text = String::from_utf8(scenes::vehicle_file(file).unwrap()).unwrap();
        let lines = text.lines().map(|line| match line.split(" =").next() {
            Some("target_m") => format!("target_m = {target_m:?}"),
            Some("mode") => format!("mode = {mode:?}"),
            Some("layout") => format!("layout = {layout:?}"),
            Some("planned_speed_mps") => "planned_speed_mps = PLANNED".to_owned(),
            // Who knows that a cable hangs says so in the vehicle file.
            Some("slack_sd_m") if self.condition == Condition::Poor => "slack_sd_m = 0.06".to_owned(),
            _ => line.to_owned(),
        });
        lines.collect::<Vec<_>>().join("\n")
    }

    /// The vehicle as it truly is.
    fn truly(&self, told: &str, plain: &Scene, seed: u64) -> String {
        let counts = |by: f64| {
            let count = 2000.0 * by;
            told.replace("counts_per_metre = 2000", &format!("counts_per_metre = {count:.1}"))
        };
        match self.condition {
            // It counts fewer than told, so that nothing lies beyond the tunnel's end.
            Condition::Poor => counts(0.995),
            Condition::WrongCable => counts(0.98),
            Condition::WrongMount => {
                let heads = of_sense(plain, Sense::Head);
                turned(told, &heads[Draw::new(seed).below(heads.len())])
            }
            _ => told.to_owned(),
        }
    }

    /// Planned speed and speed driven, m/s.
    fn speeds_mps(&self, vehicle: &VehicleConfig) -> [f64; 2] {
        let most_mps = self.plan_mps(vehicle);
        let file = scenes::vehicle_file(self.vehicle.file).unwrap();
        let file = String::from_utf8(file).unwrap();
        let file_mps = file.lines().find_map(|line| line.strip_prefix("planned_speed_mps = "));
        let file_mps = file_mps.and_then(|rest| rest.split(' ').next()?.parse::<f64>().ok());
        let planned_mps = file_mps.unwrap_or(most_mps).min(most_mps);
        match self.driven {
            Driven::Planned => [planned_mps, planned_mps],
            Driven::Times(times) => [planned_mps, times * self.vehicle.edge_mps],
            // The most that the pilot would drive.
            Driven::Advised | Driven::Back => [planned_mps, 1.2 * self.vehicle.edge_mps],
        }
    }

    /// The plan's speed, m/s.
    fn plan_mps(&self, vehicle: &VehicleConfig) -> f64 {
        planned_mps(vehicle, &self.told().replace("PLANNED", "0.1"), self.vehicle.mode)
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
                 goes_back = {}\nwander_across_m = {aside_m}\nwander_up_m = {up_m}\nwander_yaw_deg = {yaw_deg}\n\
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
        } else {
            format!(
                "start_m = {start_m}\n[[trajectory.legs]]\ndistance_m = {length_m}\nspeed_mps = {speed_mps}\n"
            )
        };
        let wider = "[[tunnel.stations]]\nchainage_m = 0\nscale = 1.06\n";
        let tunnel = if self.condition == Condition::WrongWall { wider } else { "" };
        format!(
            "seed = {seed}\nvehicle = \"vehicle.toml\"\n{tunnel}[trajectory]\n{way}[effects]\nmotion_within_turn = {{}}\n{effects}"
        )
    }

    /// No wandering into a pipe's wall.
    fn aside_m(&self, most_m: f64) -> f64 {
        if self.vehicle.name == "pipe" { 0.3 * most_m } else { most_m }
    }

    fn effects(&self, plain: &Scene, seed: u64, duration_s: f64) -> String {
        let heads = of_sense(plain, Sense::Head);
        let occlusion = "occlusion = {}\n";
        if self.condition == Condition::Clean {
            return occlusion.to_owned();
        }
        let (heads, pings) = (quoted(&heads), quoted(&of_sense(plain, Sense::Echosounder)));
        let bias = if self.condition == Condition::Poor { POOR_BIAS } else { GOOD_BIAS };
        let tables = format!(
            "[effects.beam_cone]\nsensors = {heads}\n\
             [effects.range_quantisation]\npoints = 500\nsensors = {heads}\n\
             [[effects.range_noise]]\nsd_m = 0.01\nsensors = {heads}\n\
             [[effects.range_noise]]\nsd_m = 0.02\nsensors = {pings}\n\
             [[effects.outliers]]\nshare = 0.08\nsensors = {pings}\n\
             [[effects.missing_returns]]\nshare = 0.05\nmean_run = 8\nsensors = {pings}\n"
        );
        format!(
            "{occlusion}{DATA_SHEET_SENSORS}{bias}{tables}{}{}",
            self.murk(&heads),
            self.wrong(plain, seed, duration_s)
        )
    }

    /// All along the way: effects can't be limited to stretches.
    fn murk(&self, heads: &str) -> String {
        if self.condition != Condition::Murk {
            return String::new();
        }
        let far_m = self.aside_m(3.0);
        format!(
            "[[effects.missing_returns]]\nshare = 0.2\nmean_run = 6\nsensors = {heads}\n\
             [[effects.outliers]]\nshare = 0.05\nnear_m = 0.6\nfar_m = {far_m}\nsensors = {heads}\n\
             [effects.multipath]\nshare = 0.1\nsensors = {heads}\n"
        )
    }

    /// The one thing that is wrong or breaks.
    fn wrong(&self, plain: &Scene, seed: u64, duration_s: f64) -> String {
        let mut draw = Draw::new(seed);
        match self.condition {
            Condition::WrongSound => "[effects.sound_speed_error]\nshare = 0.04\n".to_owned(),
            Condition::WrongLatency => {
                let sense = draw.one_of(&[Sense::Head, Sense::Inertial]);
                let late = quoted(&of_sense(plain, sense));
                format!("[effects.line_delay]\nlatency_ms = 300\nsensors = {late}\n")
            }
            Condition::Broken => Breakage::of(seed, plain, duration_s).effect(),
            _ => String::new(),
        }
    }
}

/// Sensors of a sense, by name.
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

/// A vehicle file one of whose heads is turned by 3 degrees about the vertical.
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
