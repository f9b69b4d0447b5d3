//! Finds the largest speed at which a vehicle's sections truly pass, for comparison with the advised and planned
//! speeds.
//!
//! A dive passes if nearly all of its sections have the verdict "pass", and if no circle without true samples
//! in these sections exceeds the target. The comparison uses `truth`, which shares nothing with the program's
//! coverage or advice.

use headrace_coverage::Verdict;
use headrace_monitor::advice_log::AdviceEntry;
use headrace_monitor::messages::Notice;
use headrace_sensor::device::Sense;
use headrace_simulator::Scene;

use crate::field_table::{VEHICLES, Vehicle};
use crate::planned::planned_mps;
use crate::random_dives::Draw;
use crate::scenes;
use crate::truth;

/// Time at the start of a dive that isn't evaluated, s, because the filter then learns the biases of the inertial unit.
const SETTLES_S: f64 = 100.0;
/// Length of the evaluated part of a dive, m.
const JUDGED_M: f64 = 8.0;
/// Fraction of the evaluated sections that must pass, as in a dive at the planned speed. No section may pass although
/// its true hole exceeds the target.
const PASSING: f64 = 0.95;
/// Number of evaluated sections of which one may fail.
const FAILING: usize = 20;
/// Speeds that are tried in the search for the largest passing speed, as multiples of the first speed. `ABOVE` has
/// speeds above the first speed, `BELOW` has speeds below it.
const ABOVE: [f64; 9] = [1.02, 1.04, 1.06, 1.08, 1.1, 1.125, 1.15, 1.2, 1.25];
const BELOW: [f64; 8] = [0.98, 0.96, 0.94, 0.92, 0.9, 0.87, 0.83, 0.75];

/// A dive to simulate: a vehicle with its mode, target and effects.
#[derive(Debug, Clone)]
pub struct Outing {
    /// The vehicle of the field table, with its layout of heads and its vehicle file.
    pub vehicle: Vehicle,
    /// Mode of the heads.
    pub mode: &'static str,
    /// Target T, m.
    pub target_m: f64,
    /// Simulator effects in addition to the sensor errors from data sheets.
    pub effects: String,
    /// Seed of the dive.
    pub seed: u64,
    /// Chainage at which the dive starts, m.
    pub start_m: f64,
    /// Fraction of the planned speed at which the vehicle drives before the first advice. The heads are in phase for
    /// this reduced speed.
    pub planned_share: f64,
}

/// Result of the evaluated part of a dive.
#[derive(Debug, Clone)]
pub struct Outcome {
    /// Fraction of the evaluated sections that pass, 0 to 1.
    pub passing: f64,
    /// Fraction of the evaluated sections with the verdict "can't say", 0 to 1.
    pub unsure: f64,
    /// Number of evaluated sections that pass although their true hole exceeds the target.
    pub falsely: usize,
    /// Largest ratio of the true hole diameter D_true to the target T among the evaluated sections.
    pub true_share: f64,
    /// Advice updates in the evaluated part of the dive.
    pub entries: Vec<AdviceEntry>,
}

/// Advised speeds of a vehicle, and the largest speed at which its sections truly pass.
#[derive(Debug, Clone)]
pub struct Compared {
    /// Planned speed, m/s.
    pub plan_mps: f64,
    /// Advised speed while the vehicle drives at the planned speed, m/s.
    pub advised_mps: f64,
    /// Largest speed near the advised speed at which sections truly pass, m/s; `None` if there is none.
    pub true_mps: Option<f64>,
    /// Result of the dive at the planned speed.
    pub planned: Outcome,
    /// Result of the dive at the advised speed.
    pub followed: Outcome,
}

impl Compared {
    /// Speed advised to a vehicle that drives at the planned speed, divided by the largest speed at which sections
    /// truly pass.
    pub fn ratio(&self) -> f64 {
        self.over_true(self.advised_mps)
    }

    /// Speed advised to a pilot who follows the advice, divided by the largest speed at which sections truly pass.
    pub fn followed_ratio(&self) -> f64 {
        self.over_true(self.followed.advised_mps())
    }

    fn over_true(&self, speed_mps: f64) -> f64 {
        self.true_mps.map_or(f64::INFINITY, |true_mps| speed_mps / true_mps)
    }
}

impl Outcome {
    /// Whether enough of the evaluated sections pass, and none of them falsely.
    pub fn passes(&self) -> bool {
        self.passing >= PASSING && self.falsely == 0
    }

    /// Median of a value over all evaluated advice updates.
    pub fn median(&self, of: impl Fn(&AdviceEntry) -> f64) -> f64 {
        let mut all: Vec<f64> = self.entries.iter().map(of).collect();
        all.sort_by(f64::total_cmp);
        all.get(all.len() / 2).copied().unwrap_or(f64::NAN)
    }

    /// Largest constant speed that exceeds the advice seldom enough, m/s. It may exceed the advice in the same fraction
    /// of updates as the fraction of sections that may fail.
    ///
    /// Some excess is allowed, because a swaying vehicle gets lower advice for short times.
    pub fn advised_mps(&self) -> f64 {
        let mut all: Vec<f64> = self.entries.iter().map(|entry| entry.advice.v_max_mps).collect();
        all.sort_by(f64::total_cmp);
        all.get(all.len() / FAILING).copied().unwrap_or(f64::NAN)
    }

    /// Number of times per minute that the displayed advised speed or its reason changes. A dive shorter than half a
    /// minute counts as half a minute long, so that a single change doesn't give a high rate.
    pub fn changes_a_minute(&self) -> f64 {
        let changed = |pair: &[AdviceEntry]| {
            (pair[0].advice.v_max_mps - pair[1].advice.v_max_mps).abs() > 1e-6
                || pair[0].advice.reason != pair[1].advice.reason
        };
        let changes = self.entries.windows(2).filter(|pair| changed(pair)).count();
        changes as f64 * 300.0 / self.entries.len().max(150) as f64
    }
}

impl Outing {
    /// A steady vehicle of the field table, with heads in phase for 0.95 times the planned speed.
    pub fn steady(vehicle: Vehicle, seed: u64) -> Self {
        Self {
            vehicle,
            mode: vehicle.mode,
            target_m: vehicle.target_m,
            effects: String::new(),
            seed,
            start_m: 5.0,
            planned_share: 0.95,
        }
    }

    /// The vehicle and dive that belong to a seed. Consecutive seeds rotate through the vehicles. In every second round
    /// through the vehicles, the vehicles sway. All other values are drawn at random.
    pub fn drawn(seed: u64) -> Self {
        let mut draw = Draw::new(seed ^ 0x5eed_ad71);
        let turn = usize::try_from(seed).unwrap();
        let vehicle = VEHICLES[turn % VEHICLES.len()];
        let sways = turn / VEHICLES.len() % 2 == 1;
        let modes = [vehicle.mode, "medium"];
        let target_m = vehicle.target_m * draw.between(1.0, 1.6);
        let aside_m = if vehicle.name == "pipe" { 0.1 } else { 0.4 };
        let sway = format!(
            "pilot_drift = {{ across_m = {:.3}, up_m = {:.3}, yaw_deg = {:.3}, period_s = {:.3} }}\n",
            draw.between(0.0, aside_m),
            draw.between(0.0, aside_m / 2.0),
            draw.between(0.5, 3.0),
            draw.between(20.0, 60.0)
        );
        Self {
            vehicle,
            mode: modes[draw.below(2)],
            target_m: if sways { 1.3 * target_m } else { target_m },
            effects: if sways { sway } else { String::new() },
            seed,
            start_m: draw.between(5.0, 250.0),
            planned_share: 0.95,
        }
    }

    /// Result of a dive at `speed_mps` with heads that are in phase for `planned_mps`.
    pub fn dive(&self, planned_mps: f64, speed_mps: f64) -> Outcome {
        let ends_m = 1.2 * self.target_m + 2.0;
        let settles_m = (SETTLES_S * speed_mps).max(ends_m);
        let length_m = settles_m + self.judged_m() + ends_m;
        let scene = self.scene(planned_mps, speed_mps, length_m);
        let from_m = self.start_m + settles_m;
        let to_m = from_m + self.judged_m();
        let mut entries = Vec::new();
        let judged = truth::dive_noting(&scene, &scene.vehicle, &mut |dive| {
            for notice in dive.view().notices() {
                if let Notice::Advice(entry) = notice
                    && entry.chainage_m.is_some_and(|x_m| x_m >= from_m && x_m <= to_m)
                {
                    entries.push(entry);
                }
            }
        });
        let within = |section: &&truth::JudgedSection| {
            section.report.start_m >= from_m && section.report.end_m <= to_m
        };
        let sections: Vec<_> = judged.sections.iter().filter(within).collect();
        let share = |verdict: Verdict| {
            let count = sections.iter().filter(|section| section.report.verdict == verdict).count();
            count as f64 / sections.len().max(1) as f64
        };
        let falsely = sections
            .iter()
            .filter(|section| section.report.verdict == Verdict::Pass && section.true_hole_m > self.target_m);
        Outcome {
            passing: share(Verdict::Pass),
            unsure: share(Verdict::CannotSay),
            falsely: falsely.count(),
            true_share: sections.iter().map(|section| section.true_hole_m).fold(0.0, f64::max)
                / self.target_m,
            entries,
        }
    }

    fn judged_m(&self) -> f64 {
        JUDGED_M.max(2.0 * self.target_m)
    }

    /// Planned speed from `plan`, m/s.
    pub fn plan_mps(&self) -> f64 {
        planned_mps(&self.scene(0.1, 0.1, 1.0).vehicle, &self.vehicle_text(0.1), self.mode)
    }

    /// Compares the planned speed, the advised speed, and the largest speed at which the sections truly pass.
    pub fn compare(&self) -> Compared {
        let plan_mps = self.plan_mps();
        let planned_mps = self.planned_share * plan_mps;
        let planned = self.dive(planned_mps, planned_mps);
        let advised_mps = planned.advised_mps();
        let at = |share: f64| self.dive(planned_mps, share * advised_mps);
        let passes = |share: f64| at(share).passes();
        let followed = at(1.0);
        let mut true_share = None;
        if advised_mps > 0.0 {
            if followed.passes() {
                true_share = Some(1.0);
                let mut missed = 0;
                for share in ABOVE {
                    if passes(share) {
                        (true_share, missed) = (Some(share), 0);
                    } else {
                        missed += 1;
                    }
                    if missed == 2 {
                        break;
                    }
                }
            } else {
                true_share = BELOW.into_iter().find(|share| passes(*share));
            }
        }
        let true_mps = true_share.map(|share| share * advised_mps);
        Compared { plan_mps, advised_mps, true_mps, planned, followed }
    }

    fn vehicle_text(&self, planned_mps: f64) -> String {
        let text = String::from_utf8(scenes::vehicle_file(self.vehicle.file).unwrap()).unwrap();
        let lines = text.lines().map(|line| match line.split(" =").next() {
            Some("target_m") => format!("target_m = {:?}", self.target_m),
            Some("mode") => format!("mode = {:?}", self.mode),
            Some("layout") => format!("layout = {:?}", self.vehicle.layout),
            Some("planned_speed_mps") => format!("planned_speed_mps = {planned_mps:?}"),
            _ => line.to_owned(),
        });
        lines.collect::<Vec<_>>().join("\n")
    }

    /// A scene of `length_m` at `speed_mps`, with heads that are in phase for `planned_mps`.
    pub fn scene(&self, planned_mps: f64, speed_mps: f64, length_m: f64) -> Scene {
        let vehicle = self.vehicle_text(planned_mps);
        let load = |_: &str| Ok(vehicle.clone().into_bytes());
        let way = format!(
            "seed = {}\nvehicle = \"vehicle.toml\"\n[trajectory]\nstart_m = {:?}\n[[trajectory.legs]]\n\
             distance_m = {length_m:?}\nspeed_mps = {speed_mps:?}\n",
            self.seed, self.start_m
        );
        let plain = scenes::seeded(&way, &load, None);
        let of_sense = |sense: Sense| -> Vec<&str> {
            let sensors = plain.facts().sensors.iter().filter(|sensor| sensor.sense == sense);
            sensors.map(|sensor| sensor.id.as_str()).collect()
        };
        let (heads, pings) = (of_sense(Sense::Head), of_sense(Sense::Echosounder));
        let effects = format!(
            "[effects]\nmotion_within_turn = {{}}\nocclusion = {{}}\ndepth_steps = {{}}\n\
             imu_noise = {{ gyro_degps_rthz = 0.007, accel_mps2_rthz = 0.001, attitude_deg = 0.3 }}\n\
             imu_bias = {{ gyro_degps = 0.003, accel_mps2 = 0.002, tau_s = 300 }}\n{}\
             [effects.beam_cone]\nsensors = {heads:?}\n\
             [effects.range_quantisation]\npoints = 500\nsensors = {heads:?}\n\
             [[effects.range_noise]]\nsd_m = 0.01\nsensors = {heads:?}\n\
             [[effects.range_noise]]\nsd_m = 0.02\nsensors = {pings:?}\n",
            self.effects
        );
        scenes::seeded(&(way + &effects), &load, None)
    }
}
