//! Cost of better navigation: methods, rates of the inertial unit, epochs and windows, near the portal and far from it.

mod cable;
mod heard;
mod words;

use std::sync::Arc;

use headrace_fusion::Navigation;
use headrace_fusion::direct::DirectNavigation;
use headrace_fusion::filter::FilterNavigation;
use headrace_fusion::filter::settings::Settings;
use headrace_geometry::frames::Vec3;
use headrace_geometry::math;
use headrace_geometry::time::DurNs;
use headrace_sampling::margin::{APART_SHARE, error_time_s};
use headrace_simulator::{START, Scenery};
use headrace_vehicle::{NavigationConfig, VehicleConfig};

use self::cable::CableNavigation;
use self::heard::RecordedReadings;
use super::figures::{error, rms};
use crate::error::CostError;
use crate::measure::{in_turns, side_by_side};
use crate::point::{Error, Interval, LeftOut, OracleError, Point, Trade, front, quantile};
use crate::scene::{Inputs, file};
use crate::verdicts::{self, Judged, inner};
use headrace_oracle::dive::{JudgedDive, Recorded};
use headrace_oracle::second;
use headrace_oracle::timed;

/// Chainages at which dives begin, m.
const CHAINAGES_M: [u32; 3] = [16, 3000, 6900];
/// Rate of the inertial unit of the vehicle files, Hz.
const USUAL_HZ: u32 = 100;
/// Error below which more accuracy changes no decision, m: a tenth of 0.5 m, the smallest shipped target.
const DECIDES_M: f64 = 0.05;
/// Resolution of the time at which the vehicle passes a section, s.
const MOMENT_S: f64 = 0.1;
/// Length of the timed part of a dive, s.
const TIMED_S: f64 = 15.0;
/// Largest difference between the errors of two settings that count as equal, m.
const RESOLUTION_M: f64 = 5e-4;
/// Minimum angle between two used returns of a head, radians. No two returns differ by so much, so navigation uses only
/// a head's first return.
const NO_RETURNS_RAD: f64 = 1e9;

/// A scene together with the chainage at which its dive starts.
struct Place {
    name: String,
    text: String,
    vehicle: String,
    speed_mps: f64,
    /// Duration of a turn of the heads, s.
    turn_s: f64,
    /// Whether all settings are tried in this scene, or only the methods.
    all_knobs: bool,
}

/// Method of navigation.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Way {
    Cable,
    Direct,
    Filter(Settings),
    Smoothed(Settings),
}

/// A setting of navigation, drawn as a marker in the chart.
#[derive(Debug, Clone)]
struct Setting {
    method: &'static str,
    knob: &'static str,
    value: String,
    number: Option<f64>,
    is_default: bool,
    rate_hz: u32,
    way: Way,
}

/// A simulated dive with the recorded input of navigation.
struct Dived {
    recorded: Recorded,
    vehicle: VehicleConfig,
    recorded_readings: RecordedReadings,
    /// The part of the recorded input for which navigation is timed.
    timed: RecordedReadings,
    by_cable: JudgedDive,
}

/// Measures the errors and costs of all settings of this trade.
///
/// Errors: see [`CostError`].
pub fn measure(inputs: &Inputs<'_>, progress: &mut dyn FnMut(&str)) -> Result<Trade, CostError> {
    let places = places(inputs)?;
    let mut prepared = Vec::new();
    for place in &places {
        progress(&format!("navigation: {}", place.name));
        prepared.push(Prepared::of(inputs, place)?);
    }
    progress("navigation: costs");
    let mut points = points(inputs, &prepared)?;
    progress("navigation: the oracle");
    let oracle = oracle(inputs, &places)?;
    front(&mut points, RESOLUTION_M);
    let reasons = words::reasons(&points);
    let advice = words::advice(&points, places.last().map_or("", |place| place.name.as_str()));
    Ok(Trade {
        name: "navigation".to_owned(),
        title: "Navigation".to_owned(),
        question: "What does more certain navigation cost, near the portal and far from it?".to_owned(),
        error_axis: "abs(D - D_true), 95th percentile of the sections, m".to_owned(),
        cost_axis: "navigation, ns of CPU a second of dive".to_owned(),
        cost_unit: "ns a second of dive".to_owned(),
        cost_is_computed: false,
        decides: Some(DECIDES_M),
        points,
        left_out: left_out(inputs),
        oracle,
        reasons,
        advice,
    })
}

/// All combinations of a scene with a start chainage.
fn places(inputs: &Inputs<'_>) -> Result<Vec<Place>, CostError> {
    let field = file("vita1-field.toml")?;
    let loose = field.replace(SLACK, "tether_slack = { reach_m = 0.45, period_s = 30 }");
    let [one_m, four_m] = inputs.effort.pick([24.0, 7.0], [28.0, 8.0]);
    let scenes = [
        ("VITA 1, field", field.to_owned(), "vita1.toml", [0.197, 21.6], one_m),
        ("VITA 1, slack cable", loose, "vita1.toml", [0.197, 21.6], one_m),
        ("VITA 2, taut cable", four_heads(field), "vita2-4.toml", [0.09, 8.0], four_m),
    ];
    let mut places = Vec::new();
    for (number, (name, text, vehicle, [speed_mps, turn_s], length_m)) in scenes.into_iter().enumerate() {
        let thirds = [1.0, 1.5, 1.0].map(|factor| (length_m / 3.0, factor * speed_mps));
        for from_m in inputs.effort.pick(&CHAINAGES_M[..1], &CHAINAGES_M[..]) {
            places.push(Place {
                name: format!("{name}, {from_m} m"),
                text: moved(&text, *from_m, &thirds)?,
                vehicle: file(vehicle)?.to_owned(),
                speed_mps,
                turn_s,
                all_knobs: number == 0 && Some(from_m) == CHAINAGES_M.first(),
            });
        }
    }
    Ok(places)
}

/// The four heads of VITA 2. `SLACK` is the cable slack of the shipped scene.
const FOUR_HEADS: &str = "\"sonar_0\", \"sonar_1\", \"sonar_2\", \"sonar_3\"";
const SLACK: &str = "tether_slack = { reach_m = 0.15, period_s = 30 }";

/// Returns the field scene with VITA 2 and four heads.
///
/// The cable is nearly taut here, because the vehicle file's slack_sd_m = 0.02 is for a taut cable.
fn four_heads(field: &str) -> String {
    let four = field.replace("vita1.toml", "vita2-4.toml").replace("\"sonar_0\"", FOUR_HEADS);
    four.replace(SLACK, "tether_slack = { reach_m = 0.03, period_s = 30 }")
}

/// Returns the field scene with VITA 2 and four heads, started at chainage `from_m`. Legs are given in metres and m/s.
///
/// Errors: the shipped scene isn't as expected.
pub(super) fn field_of_four(from_m: u32, legs: &[(f64, f64)]) -> Result<String, CostError> {
    moved(&four_heads(file("vita1-field.toml")?), from_m, legs)
}

/// Returns the field scene, started at chainage `from_m`. Legs are given in metres and m/s.
fn moved(text: &str, from_m: u32, legs: &[(f64, f64)]) -> Result<String, CostError> {
    const START: &str = "start_m = 5\n";
    const LEG: &str = "[[trajectory.legs]]\ndistance_m = 130\nspeed_mps = 0.16\n";
    if !(text.contains(START) && text.contains(LEG)) {
        let why = "the shipped scene has another trajectory than this trade changes".to_owned();
        return Err(CostError::Figure { what: "vita1-field.toml elsewhere".to_owned(), why });
    }
    let leg = |(m, mps): &(f64, f64)| format!("[[trajectory.legs]]\ndistance_m = {m}\nspeed_mps = {mps}\n");
    let legs: String = legs.iter().map(leg).collect();
    Ok(text.replace(START, &format!("start_m = {from_m}\n")).replace(LEG, &legs))
}

/// The settings for a scene: the methods and, if `all_knobs` is set, all values of the other settings.
fn settings(usual: &Settings, all_knobs: bool) -> Vec<Setting> {
    let deaf = Settings { return_step_rad: NO_RETURNS_RAD, ..*usual };
    let method = |value: &str, way, is_default| Setting {
        method: "method",
        knob: "method",
        value: value.to_owned(),
        number: None,
        is_default,
        rate_hz: USUAL_HZ,
        way,
    };
    let mut settings = vec![
        method("cable only", Way::Cable, false),
        method("direct", Way::Direct, false),
        method("filter", Way::Filter(deaf), false),
        method("filter, sonar returns", Way::Filter(*usual), true),
        method("smoothed", Way::Smoothed(*usual), false),
    ];
    if !all_knobs {
        return settings;
    }
    let knob = |knob, unit: &str, number: f64, is_default, rate_hz, way| Setting {
        method: knob,
        knob,
        value: format!("{number} {unit}"),
        number: Some(number),
        is_default,
        rate_hz,
        way: Way::Filter(way),
    };
    for rate_hz in [400, 100, 25] {
        let is_usual = rate_hz == USUAL_HZ;
        settings.push(knob("inertial unit", "Hz", f64::from(rate_hz), is_usual, rate_hz, *usual));
    }
    for epoch_s in [0.02, 0.05, 0.1, 0.2, 0.5] {
        let epoch = DurNs::from_secs_f64(epoch_s);
        let is_usual = epoch == usual.epoch;
        settings.push(knob("epoch", "s", epoch_s, is_usual, USUAL_HZ, Settings { epoch, ..*usual }));
    }
    for window_s in [0.1, 0.2, 0.5, 1.0] {
        let window = DurNs::from_secs_f64(window_s);
        let is_usual = window == usual.window;
        settings.push(knob("window", "s", window_s, is_usual, USUAL_HZ, Settings { window, ..*usual }));
    }
    settings
}

/// A scene whose dives have been judged with each setting, ready to be timed.
struct Prepared {
    scene: String,
    settings: Vec<Setting>,
    /// The distinct settings. The default lies on the lines of several varied parameters, but is measured only once.
    unique: Vec<(u32, Way)>,
    /// For each distinct setting, the number of simulated seeds and the errors.
    errors: Vec<(u32, Vec<Error>)>,
    /// Dives of the first seed, each with the rate of its inertial unit, Hz.
    first: Vec<(u32, Dived)>,
}

impl Prepared {
    fn of(inputs: &Inputs<'_>, place: &Place) -> Result<Self, CostError> {
        let usual = match inputs.vehicle(&place.vehicle)?.navigation {
            NavigationConfig::Filter(settings) => settings,
            NavigationConfig::Direct => Settings::default(),
        };
        let settings = settings(&usual, place.all_knobs);
        let mut rates: Vec<u32> = settings.iter().map(|setting| setting.rate_hz).collect();
        rates.sort_unstable();
        rates.dedup();
        let mut unique: Vec<(u32, Way)> = Vec::new();
        for setting in &settings {
            if !unique.contains(&(setting.rate_hz, setting.way)) {
                unique.push((setting.rate_hz, setting.way));
            }
        }
        let dives_of = |seed: u32| -> Result<Vec<(u32, Dived)>, CostError> {
            rates.iter().map(|rate_hz| Ok((*rate_hz, Dived::of(inputs, place, *rate_hz, seed)?))).collect()
        };
        let seeds: Vec<u32> = (1..=inputs.effort.seeds()).collect();
        let of_seeds = side_by_side(&seeds, |seed| {
            let dives = dives_of(*seed)?;
            let of = |(rate_hz, way): &(u32, Way)| {
                let dived = dives.iter().find(|(of_dive_hz, _)| of_dive_hz == rate_hz);
                dived.map(|(_, dived)| dived.figures(way, place)).transpose()
            };
            let figures = unique.iter().map(of).collect::<Result<Vec<_>, _>>()?;
            Ok((figures, (*seed == 1).then_some(dives)))
        })?;
        let mut of_unique: Vec<Vec<(Figures, JudgedDive)>> = unique.iter().map(|_| Vec::new()).collect();
        let mut first = Vec::new();
        for (figures, dives) in of_seeds {
            for (of_way, dived) in of_unique.iter_mut().zip(figures) {
                of_way.extend(dived);
            }
            first.extend(dives.into_iter().flatten());
        }
        let errors = |dives: Vec<(Figures, JudgedDive)>| {
            let (figures, dives): (Vec<Figures>, Vec<JudgedDive>) = dives.into_iter().unzip();
            (u32::try_from(dives.len()).unwrap_or(u32::MAX), errors(&figures, &dives))
        };
        let errors = of_unique.into_iter().map(errors).collect();
        Ok(Self { scene: place.name.clone(), settings, unique, errors, first })
    }

    fn cost_ns_per_s(&self, rate_hz: u32, way: &Way) -> f64 {
        let found = self.first.iter().find(|(of_dive_hz, _)| *of_dive_hz == rate_hz);
        found.map_or(f64::NAN, |(_, dived)| dived.cost_ns_per_s(way))
    }

    /// Makes a marker. `cost` returns the cost of a distinct setting, which several markers may share.
    fn point(&self, setting: &Setting, cost: impl Fn(usize) -> Option<Interval>) -> Option<Point> {
        let which = self.unique.iter().position(|unique| *unique == (setting.rate_hz, setting.way))?;
        let ((seeds, errors), cost) = self.errors.get(which).zip(cost(which))?;
        Some(Point {
            method: setting.method.to_owned(),
            knob: setting.knob.to_owned(),
            value: setting.value.clone(),
            number: setting.number,
            is_default: setting.is_default,
            scene: self.scene.clone(),
            seeds: *seeds,
            errors: errors.clone(),
            cost,
            instructions: None,
            on_front: false,
        })
    }
}

/// Times the distinct settings of all scenes, round by round.
fn points(inputs: &Inputs<'_>, prepared: &[Prepared]) -> Result<Vec<Point>, CostError> {
    let all: Vec<(&Prepared, (u32, Way))> =
        prepared.iter().flat_map(|place| place.unique.iter().map(move |unique| (place, *unique))).collect();
    let costs = in_turns(inputs.effort.rounds(), &all, |(place, (rate_hz, way))| {
        Ok(place.cost_ns_per_s(*rate_hz, way))
    })?;
    let (mut points, mut from) = (Vec::new(), 0);
    for place in prepared {
        let cost = |which: usize| costs.get(from + which).copied();
        points.extend(place.settings.iter().filter_map(|setting| place.point(setting, cost)));
        from += place.unique.len();
    }
    Ok(points)
}

/// Figures for the accuracy of navigation in one dive.
#[derive(Debug, Clone, Copy)]
struct Figures {
    turn_m: Option<f64>,
    sigma_m: Option<f64>,
    within_two: Option<f64>,
    across_m: Option<f64>,
    flag_delay_s: Option<f64>,
}

fn errors(figures: &[Figures], dives: &[JudgedDive]) -> Vec<Error> {
    let of = |name, unit, pick: fn(&Figures) -> Option<f64>| {
        let values: Vec<f64> = figures.iter().filter_map(pick).collect();
        error(name, unit, &values)
    };
    let own = [
        of("displacement between passes", "m", |figures| figures.turn_m),
        of("position across", "m", |figures| figures.across_m),
        of("estimated sigma of the displacement", "m", |figures| figures.sigma_m),
        of("displacements within two sigma", "%", |figures| figures.within_two),
        of("flag raised after its section was passed", "s", |figures| figures.flag_delay_s),
    ];
    let judged = |dive: &JudgedDive| inner(dive).map(Judged::of).collect::<Vec<_>>();
    let judged: Vec<Vec<Judged>> = dives.iter().map(judged).collect();
    let target_m = dives.first().map_or(0.0, |dive| dive.report.target_m);
    let mut errors = verdicts::errors(&judged, target_m);
    let rest = errors.split_off(errors.len().min(1));
    errors.extend(own.into_iter().flatten().chain(rest));
    errors
}

impl Dived {
    fn of(inputs: &Inputs<'_>, place: &Place, rate_hz: u32, seed: u32) -> Result<Self, CostError> {
        const PRESET: &str = "preset = \"xsens_mti600\"\n";
        let rate = format!("{PRESET}rate_hz = {rate_hz}\n");
        let text = place.vehicle.replace(PRESET, &rate);
        let vehicle = inputs.vehicle(&text)?;
        let recorded = Recorded::of(&inputs.scene_of(&place.text, &text, seed)?, &vehicle)?;
        let (recorded_readings, by_cable) = RecordedReadings::of(&recorded, &vehicle)?;
        let timed = recorded_readings.first(TIMED_S);
        Ok(Self { recorded, vehicle, recorded_readings, timed, by_cable })
    }

    fn navigation(&self, way: &Way, recorded_readings: &RecordedReadings) -> Box<dyn Navigation> {
        let (profile, site) = (&self.vehicle.tunnel.profile, self.vehicle.site);
        match way {
            Way::Cable => Box::new(CableNavigation::new(profile)),
            Way::Direct => Box::new(DirectNavigation::new(profile.clone(), site)),
            Way::Filter(settings) => Box::new(FilterNavigation::new(profile.clone(), site, *settings)),
            Way::Smoothed(settings) => Box::new(recorded_readings.smoothed(&self.vehicle, settings)),
        }
    }

    /// CPU time of navigation alone, ns per second of dive.
    fn cost_ns_per_s(&self, way: &Way) -> f64 {
        let ((), cpu_s) = timed(|| {
            let mut navigation = self.navigation(way, &self.timed);
            self.timed.run(navigation.as_mut(), &mut |at, fix| {
                std::hint::black_box((at, fix.is_ok()));
            });
        });
        cpu_s * 1e9 / self.timed.duration_s
    }

    fn figures(&self, way: &Way, place: &Place) -> Result<(Figures, JudgedDive), CostError> {
        let mut known = Vec::new();
        self.recorded_readings.run(self.navigation(way, &self.recorded_readings).as_mut(), &mut |at, fix| {
            known.extend(fix.ok().map(|fix| (at, fix, self.recorded.scenery.pose(at).position)));
        });
        let lag_s = self.between_passes_s(place);
        let mut turns: Vec<[f64; 2]> = Vec::new();
        let mut before = 0;
        for (at, fix, truth) in &known {
            while known.get(before).is_some_and(|(then, ..)| at.since(*then).as_secs_f64() > lag_s) {
                before += 1;
            }
            let then = before.checked_sub(1).and_then(|before| known.get(before));
            if let Some((_, fix_then, truth_then)) = then {
                let moved_m = fix.pose.position.x() - fix_then.pose.position.x();
                turns.push([moved_m - (truth.x() - truth_then.x()), fix.relative.sd_m(Vec3::zero())]);
            }
        }
        let sigmas: Vec<f64> = turns.iter().map(|[_, sigma_m]| *sigma_m).collect();
        let within = turns.iter().filter(|[error_m, sigma_m]| error_m.abs() <= 2.0 * sigma_m).count();
        let dive = match way {
            Way::Cable => self.dive_by_cable(),
            way => {
                self.recorded.judged_with(&self.vehicle, self.navigation(way, &self.recorded_readings), &mut |_| {})?
            }
        };
        let figures = Figures {
            turn_m: rms(turns.iter().map(|[error_m, _]| *error_m)),
            sigma_m: quantile(&sigmas, 0.5),
            within_two: (!turns.is_empty()).then(|| 100.0 * within as f64 / turns.len() as f64),
            across_m: rms(known.iter().map(|(_, fix, truth)| fix.pose.position.y() - truth.y())),
            flag_delay_s: flag_delay_s(&dive, &self.recorded.scenery),
        };
        Ok((figures, dive))
    }

    fn dive_by_cable(&self) -> JudgedDive {
        let JudgedDive { report, truth, sections } = &self.by_cable;
        JudgedDive { report: report.clone(), truth: Arc::clone(truth), sections: sections.clone() }
    }

    /// Time over which errors accumulate between neighbouring passes of a place, s. The filter uses this time, too.
    fn between_passes_s(&self, place: &Place) -> f64 {
        let heads = self.vehicle.heads();
        let passes_per_s = heads.len() as f64 / place.turn_s;
        let along = heads.iter().map(|head| head.mount.position.x());
        let apart_m = along.clone().fold(f64::NEG_INFINITY, f64::max) - along.fold(f64::INFINITY, f64::min);
        error_time_s(passes_per_s, apart_m, place.speed_mps, APART_SHARE)
    }
}

/// Mean delay from the moment at which the vehicle passes the true end of a section to the section's flag, s; `None`
/// without flags.
fn flag_delay_s(dive: &JudgedDive, scenery: &Scenery) -> Option<f64> {
    let end_s = dive.report.dive.duration_s;
    let passed_s = |chainage_m: f64| {
        let moment = |k: u32| START + DurNs::from_secs_f64(f64::from(k) * MOMENT_S);
        let last = math::floor_to_i64(end_s / MOMENT_S).try_into().unwrap_or(0);
        (0..=last).map(moment).find(|at| scenery.chainage_m(*at) >= chainage_m).map(|at| at.since(START).as_secs_f64())
    };
    let delays: Vec<f64> = dive
        .sections
        .iter()
        .filter_map(|section| {
            Some(section.report.flagged_s? - passed_s(section.report.end_m + section.shift_m)?)
        })
        .collect();
    let count = delays.len() as f64;
    (count > 0.0).then(|| delays.iter().sum::<f64>() / count)
}

/// Error of the references.
///
/// One comparison is between two computations of the true hole D_true. The other is between true places and the
/// readings of a taut cable. The readings pass through emulator, bytes and decoder, so they share only the trajectory
/// with the true places.
fn oracle(inputs: &Inputs<'_>, places: &[Place]) -> Result<OracleError, CostError> {
    let (mut hole_m, mut displacement_m) = (0.0_f64, 0.0_f64);
    for place in places.iter().filter(|place| place.all_knobs) {
        let (way, _) = place.text.split_once("[effects]").unwrap_or((&place.text, ""));
        let bare = Place { text: format!("{way}[effects]\nmotion_within_turn = {{}}\n"), ..place.copied() };
        let dived = Dived::of(inputs, &bare, USUAL_HZ, 1)?;
        for (at, chainage_m) in dived.recorded_readings.chainages() {
            displacement_m =
                displacement_m.max(2.0 * (chainage_m - dived.recorded.scenery.chainage_m(at)).abs());
        }
        let truth = &dived.recorded.truth;
        hole_m = hole_m.max(second::may_be_off_m(truth, truth.way_m, 0.25, 4)?);
    }
    Ok(OracleError {
        how: format!(
            "for D_true, Voronoi vertices are compared with lower envelopes; true displacements differ by {displacement_m:.4} m at most from the readings \
             of a taut cable, decoded from the bytes of its emulated counter (0.5 mm a count)"
        ),
        size: hole_m,
    })
}

impl Place {
    fn copied(&self) -> Self {
        Self { name: self.name.clone(), text: self.text.clone(), vehicle: self.vehicle.clone(), ..*self }
    }
}

fn left_out(inputs: &Inputs<'_>) -> Vec<LeftOut> {
    let mut left_out = vec![LeftOut {
        what: "filter settings in most scenes".to_owned(),
        why: "epoch, window and the inertial unit's rate are varied only in the field scene of VITA 1 at 16 m; the other scenes only compare methods".to_owned(),
    }];
    if inputs.effort.pick(true, false) {
        left_out.push(LeftOut {
            what: "chainages 3000 and 6900 m, four of five seeds, and the last metres of dives".to_owned(),
            why: "`--quick`; the full measurement includes them".to_owned(),
        });
    }
    left_out
}
