//! Cost of finer settings in the live loop. The settings are the number of rays that the advice casts around each head,
//! the length of a tick, and the number of vertices of a surveyed profile.

use headrace_coverage::Verdict;
use std::fmt::Write as _;

use headrace_config::Document;
use headrace_geometry::math;
use headrace_geometry::time::DurNs;
use headrace_geometry::tunnel::Profile;
use headrace_monitor::report::Report;
use headrace_monitor::run::Loop;
use headrace_replay::drive::{Driver, Pace};
use headrace_sampling::advice::{Looks, SPEED_MARGIN};
use headrace_vehicle::VehicleConfig;

use super::figures::{error, rms};
use crate::error::CostError;
use crate::measure::in_turns;
use crate::point::{Error, Interval, LeftOut, OracleError, Point, Trade, front, quantile};
use crate::scene::{Inputs, file};
use crate::words::number;
use headrace_oracle::dive::{Recorded, armed};
use headrace_oracle::{TruthError, timed};

/// Reference setting: the densest ring of rays, recast after the smallest movement. `AS_FINE` is a second reference, a
/// ring with a sixth fewer rays.
const FINEST: Looks = Looks { ring: 3600, anew_m: Some(0.001) };
const AS_FINE: Looks = Looks { ring: 3000, anew_m: Some(0.001) };
/// Difference up to which two speeds count as equal, m/s.
const RESOLUTION_MPS: f64 = 1e-5;
const USUAL_TICK_MS: u32 = 20;

/// A setting of the live loop, drawn as a marker in the chart.
struct Setting {
    method: &'static str,
    knob: &'static str,
    value: String,
    number: Option<f64>,
    is_default: bool,
    looks: Looks,
    tick_ms: u32,
}

/// Result of replaying a dive with one setting.
struct Ran {
    /// Advised speed at each update, m/s; zero if no speed was advised.
    v_max_mps: Vec<f64>,
    verdicts: Vec<(i64, Verdict)>,
    /// CPU time of each tick, s.
    ticks_s: Vec<f64>,
    digest: String,
}

/// Measures the errors and costs of all settings of this trade.
///
/// Errors: see [`CostError`].
pub fn measure(inputs: &Inputs<'_>, progress: &mut dyn FnMut(&str)) -> Result<Trade, CostError> {
    let mut prepared = Vec::new();
    let (mut size, mut slowest_mps) = (0.0_f64, f64::INFINITY);
    for (name, text) in scenes(inputs)? {
        progress(&format!("live loop: {name}"));
        let (of_scene, off_mps, v_mps) = Prepared::of(inputs, name, &text)?;
        prepared.push(of_scene);
        (size, slowest_mps) = (size.max(off_mps), slowest_mps.min(v_mps));
    }
    progress("live loop: surveyed profiles");
    prepared.push(Prepared::surveyed(inputs)?);
    progress("live loop: costs");
    let mut points = points(inputs, prepared)?;
    front(&mut points, RESOLUTION_MPS);
    let (reasons, advice) = (reasons(&points), advice(&points));
    Ok(Trade {
        name: "live".to_owned(),
        title: "Live loop".to_owned(),
        question: "What do finer rays and more frequent updates of the advice cost the live loop?".to_owned(),
        error_axis: "advised speed off, rms, m/s".to_owned(),
        cost_axis: "loop, share of a core".to_owned(),
        cost_unit: "of a core".to_owned(),
        cost_is_computed: false,
        decides: Some(SPEED_MARGIN * slowest_mps),
        points,
        left_out: left_out(inputs),
        oracle: OracleError {
            how: "advice with the finest `ring_deg` and `look_m` is compared with advice from other rays, every 0.12 degrees"
                .to_owned(),
            size,
        },
        reasons,
        advice,
    })
}

fn scenes(inputs: &Inputs<'_>) -> Result<Vec<(&'static str, String)>, CostError> {
    let rehearsal = file("rehearsal.toml")?;
    let ends_m = inputs.effort.pick(["2.6", "2.9", "3.2"], ["5.0", "7.0", "9.0"]);
    let mut shorter = rehearsal.to_owned();
    for (from, to) in ["14.0", "20.0", "32.0"].iter().zip(ends_m) {
        shorter = shorter.replace(&format!("chainage_m = {from}"), &format!("chainage_m = {to}"));
    }
    let pilot = format!("{PILOT}to_m = 8\n{PILOT_EFFECTS}");
    let mut scenes = vec![("rehearsal", shorter)];
    scenes.extend(inputs.effort.pick(None, Some(("pilot", pilot))));
    Ok(scenes)
}

/// Scene: VITA 2 with four heads, driven by a pilot who often stops, goes back and sways.
const PILOT: &str = "vehicle = \"vita2-4.toml\"\n[trajectory]\nkind = \"pilot\"\nstart_m = 5\nspeed_mps = 0.1\nstops_per_hour = 60\n\
    stop_s = [3, 8]\nbacks_per_hour = 60\nback_m = [0.5, 1]\nwander_across_m = 1.0\nwander_up_m = 0.5\nwander_yaw_deg = 10\n\
    wander_pitch_deg = 2\nwander_roll_deg = 2\n";
const PILOT_EFFECTS: &str =
    "[effects]\nmotion_within_turn = {}\nocclusion = {}\nbeam_cone = {}\nrange_noise = { sd_m = 0.01 }\n";
/// Scene: a dive of about half a metre with VITA 2, used with profiles of many vertices.
const SHORT: &str = "vehicle = \"vita2-4.toml\"\n[trajectory]\nstart_m = 5\n[[trajectory.legs]]\ndistance_m = 0.6\nspeed_mps = 0.1\n\
    [effects]\nmotion_within_turn = {}\n";

fn settings() -> Vec<Setting> {
    let setting = |method, value: String, number, is_default, looks, tick_ms| Setting {
        method,
        knob: method,
        value,
        number,
        is_default,
        looks,
        tick_ms,
    };
    let usual = Looks::default();
    let mut settings = Vec::new();
    for ring_deg in [0.1, 0.2, 0.3, 0.5, 1.0] {
        let ring = u32::try_from(math::round_to_i64(360.0 / ring_deg)).unwrap_or(usual.ring);
        let (value, is_usual) = (format!("{ring_deg} degrees"), ring == usual.ring);
        let looks = Looks { ring, ..usual };
        settings.push(setting("ring", value, Some(ring_deg), is_usual, looks, USUAL_TICK_MS));
    }
    for look_m in [0.001, 0.003, 0.01, 0.03, 0.1] {
        let looks = Looks { anew_m: Some(look_m), ..usual };
        settings.push(setting(
            "looks anew each",
            format!("{look_m} m"),
            Some(look_m),
            false,
            looks,
            USUAL_TICK_MS,
        ));
    }
    settings.push(setting("looks anew each", "as needed".to_owned(), None, true, usual, USUAL_TICK_MS));
    for tick_ms in [1, 5, 20, 50, 100] {
        let (value, is_usual) = (format!("{tick_ms} ms"), tick_ms == USUAL_TICK_MS);
        settings.push(setting("tick", value, Some(f64::from(tick_ms)), is_usual, usual, tick_ms));
    }
    settings
}

/// A recorded dive whose sections have been judged with each setting, ready to be timed.
struct Prepared {
    scene: &'static str,
    seeds: u32,
    recorded: Recorded,
    markers: Vec<Marker>,
}

/// A setting with its vehicle and its results.
struct Marker {
    setting: Setting,
    vehicle: VehicleConfig,
    against: Against,
}

impl Prepared {
    /// Prepares a scene. Also returns the difference in advised speed between the two reference settings, m/s, and the
    /// median advised speed, m/s.
    fn of(inputs: &Inputs<'_>, name: &'static str, text: &str) -> Result<(Self, f64, f64), CostError> {
        let settings = settings();
        let seeds = inputs.effort.pick(1, 3);
        let mut figures: Vec<Against> = settings.iter().map(|_| Against::default()).collect();
        let (mut size, mut v_mps) = (0.0_f64, 0.0);
        let mut first = None;
        for seed in 1..=seeds {
            let scene = inputs.scene(text, seed)?;
            let recorded = Recorded::of(&scene, &scene.vehicle)?;
            let vehicle = |looks: Looks| -> Result<VehicleConfig, CostError> {
                Ok(VehicleConfig { looks, ..inputs.vehicle(&scene.vehicle_text)? })
            };
            let finest = Ran::of(&recorded, &vehicle(FINEST)?, USUAL_TICK_MS)?;
            let as_fine = Ran::of(&recorded, &vehicle(AS_FINE)?, USUAL_TICK_MS)?;
            size = size.max(as_fine.off_mps(&finest));
            let advised_mps: Vec<f64> =
                finest.v_max_mps.iter().copied().filter(|v_mps| *v_mps > 0.0).collect();
            v_mps = quantile(&advised_mps, 0.5).unwrap_or(0.0);
            let usual = Ran::of(&recorded, &vehicle(Looks::default())?, USUAL_TICK_MS)?;
            for (setting, against) in settings.iter().zip(&mut figures) {
                let ran = Ran::of(&recorded, &vehicle(setting.looks)?, setting.tick_ms)?;
                against.take(&ran, &finest, &usual);
            }
            first.get_or_insert((recorded, scene.vehicle_text.clone()));
        }
        let why = || CostError::Figure { what: name.to_owned(), why: "no seed was simulated".to_owned() };
        let (recorded, vehicle_text) = first.ok_or_else(why)?;
        let marker = |(setting, against): (Setting, Against)| {
            let vehicle = VehicleConfig { looks: setting.looks, ..inputs.vehicle(&vehicle_text)? };
            Ok(Marker { setting, vehicle, against })
        };
        let markers = settings.into_iter().zip(figures).map(marker).collect::<Result<_, CostError>>()?;
        Ok((Self { scene: name, seeds, recorded, markers }, size, v_mps))
    }

    /// Prepares a scene with the design profile given as vertices on its outline instead of arcs, for several numbers
    /// of vertices.
    fn surveyed(inputs: &Inputs<'_>) -> Result<Self, CostError> {
        let scene = inputs.scene(SHORT, 1)?;
        let recorded = Recorded::of(&scene, &scene.vehicle)?;
        let arcs = Ran::of(&recorded, &scene.vehicle, USUAL_TICK_MS)?;
        let counts = inputs.effort.pick(&VERTICES[..3], &VERTICES[..]);
        let marker = |count: Option<u32>, vehicle: VehicleConfig| -> Result<Marker, CostError> {
            let mut against = Against::default();
            against.take(&Ran::of(&recorded, &vehicle, USUAL_TICK_MS)?, &arcs, &arcs);
            let setting = Setting {
                method: "vertices",
                knob: "vertices of the profile",
                value: count.map_or_else(|| "arcs".to_owned(), |count| count.to_string()),
                number: count.map(f64::from),
                is_default: count.is_none(),
                looks: vehicle.looks,
                tick_ms: USUAL_TICK_MS,
            };
            Ok(Marker { setting, vehicle, against })
        };
        let mut markers = vec![marker(None, inputs.vehicle(&scene.vehicle_text)?)?];
        for count in counts {
            let outline = outline(&scene.vehicle.tunnel.profile, *count);
            markers.push(marker(Some(*count), vehicle_of(inputs, &scene.vehicle_text, &outline)?)?);
        }
        Ok(Self { scene: "surveyed profile", seeds: 1, recorded, markers })
    }
}

impl Marker {
    /// Share of one core that the live loop uses.
    fn cost(&self, recorded: &Recorded) -> Result<f64, CostError> {
        let pace = Pace { tick: tick(self.setting.tick_ms), speed: None };
        Ok(recorded.cpu_with_s(&self.vehicle, self.vehicle.navigation(), pace)? / recorded.duration_s())
    }

    fn point(self, scene: &str, seeds: u32, cost: Interval) -> Point {
        let Self { setting, against, .. } = self;
        Point {
            method: setting.method.to_owned(),
            knob: setting.knob.to_owned(),
            value: setting.value,
            number: setting.number,
            is_default: setting.is_default,
            scene: scene.to_owned(),
            seeds,
            errors: against.errors(),
            cost,
            instructions: None,
            on_front: false,
        }
    }
}

/// Times all settings of all scenes, round by round.
fn points(inputs: &Inputs<'_>, prepared: Vec<Prepared>) -> Result<Vec<Point>, CostError> {
    let mut all: Vec<(&Recorded, &Marker)> = Vec::new();
    for Prepared { recorded, markers, .. } in &prepared {
        all.extend(markers.iter().map(|marker| (recorded, marker)));
    }
    let costs = in_turns(inputs.effort.rounds(), &all, |(recorded, marker)| marker.cost(recorded))?;
    let markers = prepared.into_iter().flat_map(|dive| {
        let Prepared { scene, seeds, markers, .. } = dive;
        markers.into_iter().map(move |marker| (scene, seeds, marker))
    });
    Ok(markers.zip(costs).map(|((scene, seeds, marker), cost)| marker.point(scene, seeds, cost)).collect())
}

fn tick(tick_ms: u32) -> DurNs {
    DurNs::from_millis(i64::from(tick_ms))
}

impl Ran {
    fn of(recorded: &Recorded, vehicle: &VehicleConfig, tick_ms: u32) -> Result<Self, CostError> {
        let mut dive = armed(vehicle, vehicle.navigation(), &[]).map_err(TruthError::from)?;
        let mut driver = Driver::new(&mut dive, tick(tick_ms)).map_err(TruthError::from)?;
        let mut feed = recorded.packets.feed();
        let (mut v_max_mps, mut ticks_s) = (Vec::new(), Vec::new());
        let mut note = |dive: &Loop| {
            v_max_mps.extend(dive.view().advised().entries.iter().map(|entry| entry.advice.v_max_mps));
        };
        while driver.due(&mut feed).map_err(TruthError::from)?.is_some() {
            let (ticked, tick_s) = timed(|| driver.tick(&mut dive, &mut feed, &mut note));
            ticked.map_err(TruthError::from)?;
            ticks_s.push(tick_s);
        }
        dive.finish(&mut |_, _| {});
        let report = Report::of(&dive);
        let millimetres = |m: f64| math::round_to_i64(1000.0 * m);
        let verdicts =
            report.sections.iter().map(|section| (millimetres(section.start_m), section.verdict)).collect();
        Ok(Self { v_max_mps, verdicts, ticks_s, digest: report.digest.clone() })
    }

    /// Root mean square of the differences between the advised speeds of two runs, update by update, m/s.
    fn off_mps(&self, other: &Self) -> f64 {
        rms(self.v_max_mps.iter().zip(&other.v_max_mps).map(|(a, b)| a - b)).unwrap_or(0.0)
    }

    /// Number of sections, per 100, whose verdict differs between two runs.
    fn other_verdicts(&self, other: &Self) -> f64 {
        let differing = self.verdicts.iter().zip(&other.verdicts).filter(|(a, b)| a != b).count();
        let differing = differing + self.verdicts.len().abs_diff(other.verdicts.len());
        100.0 * differing as f64 / self.verdicts.len().max(other.verdicts.len()).max(1) as f64
    }
}

/// Differences between a setting's dives and the reference dives, and the CPU times of the setting's ticks.
#[derive(Default)]
struct Against {
    off_mps: Vec<f64>,
    other_verdicts: Vec<f64>,
    other_digests: Vec<f64>,
    p50_us: Vec<f64>,
    p999_us: Vec<f64>,
}

impl Against {
    fn take(&mut self, ran: &Ran, finest: &Ran, usual: &Ran) {
        self.off_mps.push(ran.off_mps(finest));
        self.other_verdicts.push(ran.other_verdicts(usual));
        self.other_digests.push(f64::from(u8::from(ran.digest != usual.digest)));
        self.p50_us.extend(quantile(&ran.ticks_s, 0.5).map(|s| s * 1e6));
        self.p999_us.extend(quantile(&ran.ticks_s, 0.999).map(|s| s * 1e6));
    }

    fn errors(&self) -> Vec<Error> {
        let errors = [
            error("advised speed off", "m/s", &self.off_mps),
            error("other verdicts than by default", "m in 100", &self.other_verdicts),
            error("dives with another digest than by default", "share", &self.other_digests),
            error("CPU of a tick, p50", "us", &self.p50_us),
            error("CPU of a tick, p99.9", "us", &self.p999_us),
        ];
        errors.into_iter().flatten().collect()
    }
}

const VERTICES: [u32; 5] = [10, 100, 1_000, 10_000, 100_000];

/// Text of a profile file with `count` vertices at equal arc lengths.
fn outline(profile: &Profile, count: u32) -> String {
    let mut lines = String::new();
    for k in 0..count {
        let [y_m, z_m] = profile.point_at(profile.perimeter_m() * f64::from(k) / f64::from(count));
        // Writing to a string can't fail.
        let _written = writeln!(lines, "{y_m},{z_m}");
    }
    lines
}

/// A vehicle file with a surveyed profile.
fn vehicle_of(inputs: &Inputs<'_>, text: &str, outline: &str) -> Result<VehicleConfig, CostError> {
    const ARCS: &str = "profile = \"ceran\"";
    if !text.contains(ARCS) {
        let why = format!("the vehicle file has no line {ARCS}");
        return Err(CostError::Figure { what: "a surveyed profile".to_owned(), why });
    }
    let text = text.replace(ARCS, "profile = \"polyline\"\nfile = \"outline.csv\"");
    let load = |_: &str| Ok(outline.to_owned());
    Ok(VehicleConfig::parse(Document::new("a surveyed vehicle", &text), inputs.kinds, &load)?)
}

fn left_out(inputs: &Inputs<'_>) -> Vec<LeftOut> {
    let mut left_out = Vec::new();
    if inputs.effort.pick(true, false) {
        left_out.push(LeftOut {
            what: "a lively pilot, most of the demonstration's way, two of three seeds, and profiles of 10,000 and 100,000 vertices".to_owned(),
            why: "`--quick`; the full measurement includes them".to_owned(),
        });
    }
    left_out
}

/// For each scene, the savings with the coarsest ring and with the longest tick, and the reasons why neither is the
/// default.
fn reasons(points: &[Point]) -> Vec<String> {
    let mut scenes: Vec<&str> = Vec::new();
    for point in points.iter().filter(|point| point.method == "tick") {
        if !scenes.contains(&point.scene.as_str()) {
            scenes.push(&point.scene);
        }
    }
    // Finds the default setting of a method in a scene, and the setting with the largest value: the coarsest ring of
    // rays, or the longest tick.
    let pair = |scene: &str, method: &str| {
        let of = || points.iter().filter(|point| point.scene == scene && point.method == method);
        let coarsest = of().max_by(|a, b| a.number.unwrap_or(0.0).total_cmp(&b.number.unwrap_or(0.0)))?;
        Some((of().find(|point| point.is_default)?, coarsest))
    };
    let saved = |usual: &Point, other: &Point| number(100.0 * (1.0 - other.cost.middle / usual.cost.middle));
    let verdicts = |point: &Point| {
        let found = point.errors.iter().find(|error| error.name.starts_with("other verdicts"));
        number(found.map_or(f64::NAN, |error| error.interval.middle))
    };
    let mut reasons = Vec::new();
    for scene in scenes {
        if let (Some((ring, coarse)), Some((tick, long))) = (pair(scene, "ring"), pair(scene, "tick")) {
            reasons.push(format!(
                "Scene `{scene}`: rays every {} are the default. Rays every {} would save {} % of the loop's time, but the advised speed would be {} \
                 m/s off instead of {}, and the finest mode of a head has steps of 0.3 degrees. Ticks of {} are the default, so that an \
                 operator does not wait; ticks of {} would save {} % and change the verdict of {} m in 100.",
                ring.value,
                coarse.value,
                saved(ring, coarse),
                number(coarse.error()),
                number(ring.error()),
                tick.value,
                long.value,
                saved(tick, long),
                verdicts(long)
            ));
        }
    }
    reasons
}

fn advice(points: &[Point]) -> String {
    let of = |method: &str, is: &dyn Fn(&Point) -> bool| {
        points.iter().find(|point| point.method == method && is(point)).cloned()
    };
    let ring =
        of("ring", &|point| point.is_default).zip(of("ring", &|point| point.value.starts_with("0.1 ")));
    let arcs = of("vertices", &|point| point.is_default);
    let most = points.iter().rfind(|point| point.method == "vertices");
    let ring = ring.map(|(usual, finest)| {
        format!(
            "Rays every 0.1 degrees instead of 0.3 change the advised speed by {:.2} mm/s and take {:.2} times the loop's time.",
            1e3 * (usual.error() - finest.error()).abs(),
            finest.cost.middle / usual.cost.middle,
        )
    });
    let vertices = arcs.zip(most).map(|(arcs, most)| {
        let times = most.cost.middle / arcs.cost.middle;
        format!(
            "With a surveyed profile of {} vertices, the loop takes {times:.1} times as long as with a profile of arcs.",
            most.value
        )
    });
    [ring, vertices].into_iter().flatten().collect::<Vec<_>>().join(" ")
}
