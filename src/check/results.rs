//! Text and JSON of a self-test's results.

use headrace_config::plain::one_line;
use headrace_geometry::time::DurNs;
use headrace_replay::log::WARN_BELOW_BYTES;
use headrace_sensor::device_clock::MOST_DRIFT;
use serde_json::{Value, json};

use super::self_test::{Fault, Noise, Results, SensorResult};
use crate::output::append;
use crate::recording_state::SHOWN_FROM;
use crate::report_output::utc_text;

/// Minimum number of spare cores. A dive with four heads takes a small part of a core (ARCHITECTURE.md), and the rest
/// is a reserve for the page's viewers.
const LEAST_SPARE: f64 = 0.5;
const GIB: f64 = (1_u64 << 30) as f64;

impl Results {
    /// Faults, each with the name of the faulty part. Faults of the computer come first, because they may cause faults
    /// of sensors.
    fn faults(&self) -> Vec<(&str, Fault)> {
        let mut faults = self.disk_faults();
        if self.is_interrupted {
            let problem = "it was ended before its time".to_owned();
            faults.push(("test", Fault::new("ENDED", problem, "repeat it")));
        }
        if let Some((spare, _)) = self.cpu.filter(|(spare, _)| *spare < LEAST_SPARE) {
            let problem = format!("{spare:.2} cores are spare; needed are {LEAST_SPARE}");
            faults.push(("CPU", Fault::new("BUSY", problem, "end other programs")));
        }
        for sensor in &self.sensors {
            faults.extend(sensor.faults.iter().map(|fault| (sensor.id.as_str(), fault.clone())));
        }
        faults
    }

    fn disk_faults(&self) -> Vec<(&'static str, Fault)> {
        let mut faults = Vec::new();
        let mut add = |word, problem, action| faults.push(("disk", Fault::new(word, problem, action)));
        let (most_s, least_gib) = (SHOWN_FROM.as_secs_f64(), WARN_BELOW_BYTES as f64 / GIB);
        match &self.disk.syncs {
            Ok([_, longest]) if *longest < SHOWN_FROM => {}
            Ok([_, longest]) => {
                let problem = format!("a sync took {:.1} s; allowed are {most_s} s", longest.as_secs_f64());
                add("SLOW", problem, "use another disk or card");
            }
            Err(error) => {
                add("FAILS", format!("writing failed: {error}"), "use another disk or card");
            }
        }
        if let Some(free) = self.disk.free_bytes.filter(|free| *free < WARN_BELOW_BYTES) {
            let problem = format!("{:.1} GiB are free; needed are {least_gib}", free as f64 / GIB);
            add("FULL", problem, "copy old dives to another disk and delete them");
        }
        faults
    }

    /// Whether the test has found no fault.
    pub(super) fn is_ready(&self) -> bool {
        self.faults().is_empty()
    }

    /// A line for each sensor and each part of the computer, and the verdict.
    pub(super) fn text(&self) -> String {
        let faults = self.faults();
        let rows = std::iter::once(TITLES.map(str::to_owned)).chain(self.sensors.iter().map(row));
        let mut text = table(&rows.collect::<Vec<_>>()) + "\n";
        let verdict =
            |name: &str| faults.iter().find(|(of, _)| *of == name).map_or("ok", |(_, fault)| fault.word);
        let computer = [("disk", self.disk_words()), ("CPU", self.cpu_words())];
        for (name, words) in computer {
            append(&mut text, format_args!("{name:<4}  {:<7}  {words}\n", verdict(name)));
        }
        append(
            &mut text,
            format_args!("time  {}, on this computer; reports state it\n", utc_text(self.utc_s)),
        );
        if faults.is_empty() {
            return text + "ready to dive\n";
        }
        text.push_str("not ready to dive:\n");
        for (name, Fault { problem, action, .. }) in &faults {
            append(&mut text, format_args!("  {name}: {}: {action}\n", one_line(problem)));
        }
        text
    }

    fn disk_words(&self) -> String {
        let (most_s, least_gib) = (SHOWN_FROM.as_secs_f64(), WARN_BELOW_BYTES as f64 / GIB);
        let sync = self.disk.syncs.as_ref().map_or("no sync".to_owned(), |[median, longest]| {
            let [median_s, longest_s] = [median, longest].map(|sync| sync.as_secs_f64());
            format!("sync {median_s:.3} s, longest {longest_s:.3} s (at most {most_s} s)")
        });
        let free = self.disk.free_bytes.map(|bytes| bytes as f64 / GIB);
        let free = free.map(|gib| format!("; {gib:.1} GiB free (at least {least_gib} GiB)"));
        sync + &free.unwrap_or_default()
    }

    fn cpu_words(&self) -> String {
        let spare = |(spare, cores)| format!("{spare:.2} of {cores} cores spare (at least {LEAST_SPARE})");
        self.cpu.map_or("unknown".to_owned(), spare)
    }

    /// The results as JSON.
    pub(super) fn json(&self) -> Value {
        let faults = self.faults();
        let faults = faults.iter().map(|(name, Fault { word, problem, action })| {
            json!({"part": name, "fault": word, "problem": problem, "action": action})
        });
        let syncs_s = self.disk.syncs.as_ref().ok().map(|syncs| syncs.map(DurNs::as_secs_f64));
        json!({
            "sensors": self.sensors.iter().map(sensor_json).collect::<Vec<_>>(),
            "disk": {
                "sync_s": syncs_s.map(|[median_s, _]| median_s), "longest_sync_s": syncs_s.map(|[_, longest_s]| longest_s),
                "free_bytes": self.disk.free_bytes,
            },
            "spare_cores": self.cpu.map(|(spare, _)| spare),
            "utc": utc_text(self.utc_s),
            "ready": self.is_ready(),
            "faults": faults.collect::<Vec<_>>(),
        })
    }
}

/// Titles of the sensors' columns.
const TITLES: [&str; 6] = [
    "sensor",
    "verdict",
    "readings/s (expected)",
    "longest gap (most)",
    "clock drift (most)",
    "noise at rest, sd (expected, source)",
];

/// Rows as lines, with columns of equal width.
fn table(rows: &[[String; 6]]) -> String {
    let mut widths = [0; 6];
    for row in rows {
        for (width, cell) in widths.iter_mut().zip(row) {
            *width = cell.chars().count().max(*width);
        }
    }
    let mut text = String::new();
    for row in rows {
        let mut line = String::new();
        for (width, cell) in widths.iter().zip(row) {
            append(&mut line, format_args!("{cell:<width$}  "));
        }
        append(&mut text, format_args!("{}\n", line.trim_end()));
    }
    text
}

/// Row of a sensor.
fn row(sensor: &SensorResult) -> [String; 6] {
    let gap = sensor.gap.map_or("-".to_owned(), |gap| {
        format!("{:.2} s ({} s)", gap.as_secs_f64(), sensor.most_gap().as_secs_f64())
    });
    let clock = sensor.clock.as_ref().and_then(|clock| clock.drift_ppm.zip(clock.drift_sd_ppm));
    let clock = clock.map(|(ppm, sd_ppm)| format!("{ppm:+.0}, sd {sd_ppm:.0} ppm ({:.0})", MOST_DRIFT * 1e6));
    let noise = |noise: &Noise| {
        let ([name, unit], expected) = (noise.quantity.name_and_unit(), noise.expected);
        format!("{name} {:.3} {unit} ({:.3}, {})", noise.sd, expected.sd, expected.source)
    };
    let noises: Vec<String> = sensor.noises.iter().map(noise).collect();
    [
        sensor.id.clone(),
        sensor.faults.first().map_or("ok", |fault| fault.word).to_owned(),
        format!("{:.1} ({:.1})", sensor.rate_hz, sensor.expected_hz),
        gap,
        clock.unwrap_or_else(|| "-".to_owned()),
        if sensor.without_echo { "no echo, as in air".to_owned() } else { noises.join(", ") },
    ]
}

fn sensor_json(sensor: &SensorResult) -> Value {
    let noise = |noise: &Noise| {
        let [name, unit] = noise.quantity.name_and_unit();
        json!({
            "quantity": name, "unit": unit, "sd": noise.sd,
            "expected_sd": noise.expected.sd, "source": noise.expected.source,
        })
    };
    json!({
        "id": sensor.id,
        "ok": sensor.faults.is_empty(),
        "rate_hz": sensor.rate_hz,
        "expected_hz": sensor.expected_hz,
        "longest_gap_s": sensor.gap.map(DurNs::as_secs_f64),
        "drift_ppm": sensor.clock.as_ref().and_then(|clock| clock.drift_ppm),
        "noise": sensor.noises.iter().map(noise).collect::<Vec<_>>(),
    })
}

#[cfg(test)]
mod tests {
    use std::io;

    use headrace_monitor::report::DeviceClockReport;

    use super::*;
    use crate::check::computer::Disk;
    use crate::check::expected::ExpectedNoise;
    use crate::check::readings::Quantity;

    fn sensor(id: &str, rate_hz: f64, noises: Vec<Noise>, faults: Vec<Fault>) -> SensorResult {
        let is_silent = rate_hz < 1.0;
        SensorResult {
            id: id.to_owned(),
            rate_hz,
            expected_hz: 100.0,
            gap: (!is_silent).then_some(DurNs(31_000_000)),
            late: DurNs(0),
            noises,
            clock: None,
            without_echo: false,
            faults,
        }
    }

    fn noise(quantity: Quantity, sd: f64) -> Noise {
        Noise { quantity, sd, expected: ExpectedNoise { sd: 0.077, source: "data sheet" } }
    }

    fn imu() -> SensorResult {
        let clock = DeviceClockReport {
            stamps: 1000,
            restarts: 0,
            jumps: 0,
            span_s: 10.0,
            drift_ppm: Some(12.3),
            drift_sd_ppm: Some(4.0),
        };
        let noises = vec![noise(Quantity::TurnRate, 0.0812), noise(Quantity::Acceleration, 0.0064)];
        SensorResult { clock: Some(clock), ..sensor("imu", 99.96, noises, Vec::new()) }
    }

    fn results(sensors: Vec<SensorResult>, syncs: io::Result<[DurNs; 2]>, spare: f64) -> Results {
        let disk = Disk { syncs, free_bytes: Some(34 << 30) };
        Results { sensors, disk, cpu: Some((spare, 4)), is_interrupted: false, utc_s: 1_796_000_000.0 }
    }

    #[test]
    fn vehicle_without_faults_is_ready_to_dive() {
        let in_air = SensorResult { without_echo: true, ..sensor("ping_0", 100.0, Vec::new(), Vec::new()) };
        let results = results(vec![imu(), in_air], Ok([DurNs(3_000_000), DurNs(41_000_000)]), 3.4);
        assert!(results.is_ready());
        insta::assert_snapshot!(results.text(), @r"
        sensor  verdict  readings/s (expected)  longest gap (most)  clock drift (most)   noise at rest, sd (expected, source)
        imu     ok       100.0 (100.0)          0.03 s (2 s)        +12, sd 4 ppm (500)  turn rate 0.081 degrees/s (0.077, data sheet), acceleration 0.006 m/s2 (0.077, data sheet)
        ping_0  ok       100.0 (100.0)          0.03 s (2 s)        -                    no echo, as in air

        disk  ok       sync 0.003 s, longest 0.041 s (at most 2 s); 34.0 GiB free (at least 1 GiB)
        CPU   ok       3.40 of 4 cores spare (at least 0.5)
        time  2026-11-30T00:53:20Z, on this computer; reports state it
        ready to dive
        ");
    }

    #[test]
    fn interrupted_test_is_a_fault() {
        let results = results(vec![imu()], Ok([DurNs(3_000_000), DurNs(41_000_000)]), 3.4);
        let interrupted = Results { is_interrupted: true, ..results };
        assert!(!interrupted.is_ready());
        assert!(
            interrupted
                .text()
                .contains("not ready to dive:\n  test: it was ended before its time: repeat it")
        );
    }

    #[test]
    fn gap_limit_of_a_slow_device_is_three_readings() {
        let slow = SensorResult { expected_hz: 0.2, ..imu() };
        assert_eq!([slow.most_gap(), imu().most_gap()], [DurNs(15_000_000_000), DurNs(2_000_000_000)]);
    }

    #[test]
    fn every_fault_is_listed_with_its_action() {
        let silent = Fault::new(
            "NO DATA",
            "opening tcp:10.0.0.5:4040: no device listens there".to_owned(),
            "check power and cable",
        );
        let sensors = vec![imu(), sensor("sonar_0", 0.0, Vec::new(), vec![silent])];
        let slow = results(sensors, Ok([DurNs(3_000_000), DurNs(2_400_000_000)]), 0.2);
        assert!(!slow.is_ready());
        insta::assert_snapshot!(slow.text(), @r"
        sensor   verdict  readings/s (expected)  longest gap (most)  clock drift (most)   noise at rest, sd (expected, source)
        imu      ok       100.0 (100.0)          0.03 s (2 s)        +12, sd 4 ppm (500)  turn rate 0.081 degrees/s (0.077, data sheet), acceleration 0.006 m/s2 (0.077, data sheet)
        sonar_0  NO DATA  0.0 (100.0)            -                   -

        disk  SLOW     sync 0.003 s, longest 2.400 s (at most 2 s); 34.0 GiB free (at least 1 GiB)
        CPU   BUSY     0.20 of 4 cores spare (at least 0.5)
        time  2026-11-30T00:53:20Z, on this computer; reports state it
        not ready to dive:
          disk: a sync took 2.4 s; allowed are 2 s: use another disk or card
          CPU: 0.20 cores are spare; needed are 0.5: end other programs
          sonar_0: opening tcp:10.0.0.5:4040: no device listens there: check power and cable
        ");
        let full = Disk { syncs: Err(io::Error::other("read-only")), free_bytes: Some(1 << 29) };
        let full = Results { disk: full, ..slow };
        let json = full.json();
        assert_eq!(json["ready"], false);
        let faults: Vec<&str> =
            json["faults"].as_array().unwrap().iter().map(|fault| fault["fault"].as_str().unwrap()).collect();
        assert_eq!(faults, ["FAILS", "FULL", "BUSY", "NO DATA"]);
    }
}
