//! Self-test: runs the vehicle's devices as in a dive, and compares them with the vehicle file.

use std::cell::RefCell;
use std::path::Path;
use std::rc::Rc;
use std::sync::atomic::Ordering;

use headrace_geometry::site::Site;
use headrace_geometry::time::{DurNs, MonoNs};
use headrace_monitor::alert_list::{AlertState, ListedAlertJson};
use headrace_monitor::report::{DeviceClockReport, SourceReport};
use headrace_monitor::run::Loop;
use headrace_ports::{Phase, Status};
use headrace_sampling::head::SILENT_AFTER;
use headrace_sensor::device::{Device, Sense, SensorKind};
use headrace_sensor::device_clock::MOST_DRIFT;
use headrace_vehicle::VehicleConfig;

use super::computer::{CpuTimes, Disk, DiskTest};
use super::expected::{self, ExpectedNoise};
use super::readings::{Quantity, SensorReadings, Series};
use crate::dive::Assembly;
use crate::failure::Failure;
use crate::follower::Follower;
use crate::interrupt;
use crate::live;
use crate::progress::Progress;
use crate::watch::Watch;

/// Smallest share of its expected rate at which a sensor isn't reported as slow. It is below 1 because a busy computer
/// delays some readings.
const LEAST_RATE: f64 = 0.8;
/// Largest multiple of its expected noise at which a sensor isn't reported as noisy. It is above 1 because data sheets
/// state typical values.
const MOST_NOISE: f64 = 3.0;
/// Largest allowed share of damaged frames. A sound line has no damaged frames.
const MOST_DAMAGED: f64 = 0.01;

/// Alerts about a sensor whose readings don't change.
const STUCK: [&str; 2] = ["sensor_stalled", "sensor_hung"];
/// Longest time until a sensor's first reading, as the default of `--require-within`.
const MOST_LATE: DurNs = DurNs(30_000_000_000);

/// Results of a self-test.
pub(super) struct Results {
    pub(super) sensors: Vec<SensorResult>,
    pub(super) disk: Disk,
    /// Number of spare cores, and number of cores; `None` if the system doesn't report it.
    pub(super) cpu: Option<(f64, usize)>,
    /// Whether the test was ended before its time.
    pub(super) is_interrupted: bool,
    /// UTC according to the computer, seconds.
    pub(super) utc_s: f64,
}

/// Measured and expected values of a sensor.
pub(super) struct SensorResult {
    pub(super) id: String,
    /// Readings per second.
    pub(super) rate_hz: f64,
    pub(super) expected_hz: f64,
    /// Longest time without a reading; `None` without readings.
    pub(super) gap: Option<DurNs>,
    /// Time until the first reading.
    pub(super) late: DurNs,
    pub(super) noises: Vec<Noise>,
    pub(super) clock: Option<DeviceClockReport>,
    /// Whether a sonar found no echo.
    pub(super) without_echo: bool,
    pub(super) faults: Vec<Fault>,
}

impl SensorResult {
    /// Longest allowed time without a reading. A slow device may miss two readings.
    pub(super) fn most_gap(&self) -> DurNs {
        DurNs::from_secs_f64(SILENT_AFTER.as_secs_f64().max(3.0 / self.expected_hz))
    }
}

/// Noise of a quantity at rest.
pub(super) struct Noise {
    pub(super) quantity: Quantity,
    pub(super) sd: f64,
    pub(super) expected: ExpectedNoise,
}

/// A reason not to dive, and the action that removes it.
#[derive(Clone)]
pub(super) struct Fault {
    /// Name of the fault, one or two words.
    pub(super) word: &'static str,
    pub(super) problem: String,
    pub(super) action: String,
}

impl Fault {
    pub(super) fn new(word: &'static str, problem: String, action: &str) -> Self {
        Self { word, problem, action: action.to_owned() }
    }
}

/// Keeps the readings of a dive.
struct ReadingsKeeper {
    readings: Rc<RefCell<Vec<SensorReadings>>>,
    site: Site,
    /// Least confidence of each sensor's ranges that navigation uses.
    least_confidences: Vec<f64>,
}

impl Follower for ReadingsKeeper {
    fn tick(&mut self, dive: &Loop) {
        let mut readings = self.readings.borrow_mut();
        for event in dive.view().readings() {
            if let Some(sensor) = readings.get_mut(event.source.index()) {
                let least = self.least_confidences.get(event.source.index()).copied();
                sensor.add(event, self.site, least.unwrap_or(0.0));
            }
        }
    }

    fn end(&mut self, _: &Loop) {}
}

/// Runs the devices for `duration`, or until Ctrl-C. `folder` is the folder in which dives are recorded.
///
/// Errors: the devices can't be run, or no file can be created in the folder.
pub(super) fn run(
    (vehicle, text): (&VehicleConfig, &str),
    duration: DurNs,
    folder: &Path,
) -> Result<Results, Failure> {
    let readings = Rc::new(RefCell::new(vec![SensorReadings::default(); vehicle.sensors.len()]));
    let least = |device: &dyn Device| match device.specification().kind {
        SensorKind::Echosounder { min_confidence } => min_confidence,
        _ => 0.0,
    };
    let least_confidences = vehicle.sensors.iter().map(|device| least(device.as_ref())).collect();
    let keeper = ReadingsKeeper { readings: Rc::clone(&readings), site: vehicle.site, least_confidences };
    let mut dive = Assembly::of(vehicle, text).kept(true).assemble()?;
    let interrupted = interrupt::flag()?;
    let begun = headrace_ports::now();
    let supervisor = live::supervisor(&mut dive, vehicle, begun)?;
    // The disk's test begins last, so that no error leaves its file behind.
    let disk = DiskTest::start(folder)?;
    let cpu = CpuTimes::read();
    let ended = || interrupted.load(Ordering::Relaxed) || headrace_ports::now() >= begun + duration;
    let mut statuses: Vec<Option<Status>> = vec![None; vehicle.sensors.len()];
    let mut watch = Watch::quiet().followed_by(Box::new(keeper));
    let mut progress = Progress::start();
    dive.run_live(&supervisor, &ended, &mut watch, &mut |supervisor, _| {
        while let Some(status) = supervisor.next_status() {
            if let Some(latest) = statuses.get_mut(status.source) {
                *latest = Some(status);
            }
        }
        let share = headrace_ports::now().since(begun).as_secs_f64() / duration.as_secs_f64();
        progress.at(|| ("testing the devices".to_owned(), Some(share)));
    });
    drop(progress);
    let end = headrace_ports::now();
    let is_interrupted = end < begun + duration;
    let cpu = CpuTimes::read().zip(cpu).map(|(after, before)| after.spare_since(&before));
    let disk = disk.end();
    let report = dive.end_live(supervisor, &mut watch);
    let (_, utc) = headrace_ports::clock_anchor();
    let test = Test { vehicle, text, begun, end };
    let programs = &mut vehicle.programs().map_err(Failure::Plan)?.into_iter();
    let mut sensors = Vec::new();
    let measured = readings.borrow();
    for ((source, status), (device, readings)) in
        report.sources.iter().zip(&statuses).zip(vehicle.sensors.iter().zip(&*measured))
    {
        let head = device.head().and_then(|_| programs.next());
        let expected_hz = expected::rate_hz(device.as_ref(), head, vehicle.site);
        let mut result = test.result(source, status.as_ref(), (device.sense(), expected_hz), readings);
        let is_stuck = |alert: &&ListedAlertJson| {
            let is_active = alert.state == AlertState::Active && STUCK.contains(&alert.kind);
            is_active && alert.sensor.as_ref() == Some(&source.id)
        };
        let stuck = report.alert_list.iter().filter(is_stuck);
        result.faults.extend(stuck.map(|alert| Fault::new("STUCK", alert.text.clone(), &alert.advice)));
        sensors.push(result);
    }
    Ok(Results { sensors, disk, cpu, is_interrupted, utc_s: utc.0 as f64 / 1e9 })
}

/// The vehicle, and the end of its test.
struct Test<'a> {
    vehicle: &'a VehicleConfig,
    text: &'a str,
    begun: MonoNs,
    end: MonoNs,
}

impl Test<'_> {
    fn result(
        &self,
        source: &SourceReport,
        status: Option<&Status>,
        (sense, expected_hz): (Sense, f64),
        readings: &SensorReadings,
    ) -> SensorResult {
        let main = readings.main();
        let noise = |(quantity, series): (&Quantity, &Series)| {
            let expected = expected::noise(self.vehicle, self.text, (sense, *quantity), series.rate_hz())?;
            Some(Noise { quantity: *quantity, sd: series.noise_sd()?, expected })
        };
        let noises: Vec<Noise> = readings.0.iter().filter_map(noise).collect();
        let is_sonar = matches!(sense, Sense::Head | Sense::Echosounder);
        let mut result = SensorResult {
            id: source.id.clone(),
            rate_hz: main.map_or(0.0, Series::rate_hz),
            expected_hz,
            gap: main.map(|series| series.longest_gap(self.end)),
            late: main.map_or(DurNs(0), |series| series.first.since(self.begun)),
            without_echo: is_sonar && main.is_some_and(|series| !series.has_values()),
            noises,
            clock: source.device_clock.clone(),
            faults: Vec::new(),
        };
        result.faults = faults(&result, source, status);
        result
    }
}

/// Faults of a sensor, the gravest first.
fn faults(result: &SensorResult, source: &SourceReport, status: Option<&Status>) -> Vec<Fault> {
    let is_running = status.is_some_and(|status| status.phase == Phase::Running);
    let words = status.map_or("its line was never opened", |status| status.words.as_str()).to_owned();
    let power = "check power and cable";
    let Some(gap) = result.gap else {
        let problem = source.no_reading.clone().filter(|_| is_running).unwrap_or(words);
        return vec![Fault::new("NO DATA", problem, power)];
    };
    let mut faults = Vec::new();
    let mut add = |word, problem: String, action: &str| faults.push(Fault::new(word, problem, action));
    if result.late > MOST_LATE {
        let (late_s, most_s) = (result.late.as_secs_f64(), MOST_LATE.as_secs_f64());
        add("LATE", format!("its first reading came after {late_s:.0} s; allowed are {most_s} s"), power);
    }
    if !is_running {
        add("LOST", words, power);
    } else if gap > result.most_gap() {
        let most_s = result.most_gap().as_secs_f64();
        add("GAP", format!("no reading for {:.1} s; allowed are {most_s} s", gap.as_secs_f64()), power);
    }
    let (rate_hz, expected_hz) = (result.rate_hz, result.expected_hz);
    if is_running && rate_hz < LEAST_RATE * expected_hz {
        let problem = format!("{rate_hz:.1} readings/s; expected are {expected_hz:.1}");
        add("SLOW", problem, "set the device's rate, or its rate in the vehicle file");
    }
    let frames = source.frames + source.bad_frames;
    let dropped = source.line.as_ref().map_or(0, |line| line.dropped_packets);
    if dropped > 0 {
        add("DROPS", format!("{dropped} packets were dropped"), "end other programs; check the network");
    }
    if source.bad_frames as f64 > MOST_DAMAGED * frames as f64 {
        let problem = format!("{} of {frames} frames are damaged", source.bad_frames);
        add("DAMAGED", problem, "check cable, interference and baud rate");
    }
    for noise in &result.noises {
        let [name, unit] = noise.quantity.name_and_unit();
        let ExpectedNoise { sd, source } = noise.expected;
        if noise.sd > MOST_NOISE * sd {
            let problem =
                format!("noise of the {name} is {:.3} {unit} (sd); expected is {sd:.3} ({source})", noise.sd);
            add("NOISY", problem, "keep the vehicle at rest; check mount and interference");
        }
    }
    if let Some(clock) = &result.clock {
        let most_ppm = MOST_DRIFT * 1e6;
        let events = clock.restarts + clock.jumps;
        if events > 0 {
            add("CLOCK", format!("its clock restarted or jumped {events} times"), "check its power supply");
        }
        if let (Some(ppm), Some(sd_ppm)) = (clock.drift_ppm, clock.drift_sd_ppm)
            && ppm.abs() - 2.0 * sd_ppm > most_ppm
        {
            let problem = format!("its clock drifts by {ppm:+.0} ppm; allowed are {most_ppm:.0} ppm");
            add("CLOCK", problem, "check the time unit in the vehicle file");
        }
    }
    faults
}
