//! Simulated dives whose live advice is recorded at each update, as the pilot sees it.

use headrace_geometry::time::DurNs;
use headrace_monitor::App;
use headrace_monitor::advice_log::AdviceEntry;
use headrace_monitor::report::Report;
use headrace_monitor::ring::{Port, RingError};
use headrace_replay::drive::{Coming, Pace, PacketSource, drive};
use headrace_replay::log::LogError;
use headrace_sensor::device::Direction;
use headrace_sensor::reading::SourceId;
use headrace_simulator::{Scene, Simulation};

/// Feed of a simulated dive in which one source may stay silent.
struct Partly {
    simulation: Simulation,
    dumb: Option<usize>,
}

impl PacketSource for Partly {
    fn coming(&mut self) -> Result<Option<Coming>, LogError> {
        while let Some(message) = self.simulation.peek_message() {
            let dumb = self.dumb == Some(usize::from(message.source));
            if message.direction == Direction::Received && !dumb {
                let source = SourceId(message.source);
                return Ok(Some(Coming { at: message.at, source, len: message.bytes.len() }));
            }
            self.simulation.next_message();
        }
        Ok(None)
    }

    fn send(&mut self, port: &mut Port) -> Result<(), RingError> {
        if let Some(message) = self.simulation.peek_message() {
            port.send(message.at, message.bytes)?;
            self.simulation.next_message();
        }
        Ok(())
    }
}

/// Advice at each update of a dive, with the dive's report and digest.
pub struct Advised {
    /// Advice at each update of the dive.
    pub entries: Vec<AdviceEntry>,
    /// Report of the dive.
    pub report: Report,
    /// Digest of the dive's results.
    pub digest: u64,
}

/// Simulates a scene and replays it with ticks of length `tick`. The source with the id `dumb` sends nothing.
pub fn dive(scene: &Scene, dumb: Option<&str>, tick: DurNs) -> Advised {
    let vehicle = &scene.vehicle;
    let mut app = App::new(vehicle.mission());
    for sensor in &vehicle.sensors {
        app.add_device(sensor.as_ref()).unwrap();
    }
    let mut dive = app.arm(vehicle.navigation()).unwrap();
    let dumb = dumb.map(|id| dive.sources().iter().position(|source| source.id == id).unwrap());
    let mut feed = Partly { simulation: Simulation::new(scene).unwrap_or_else(|why| panic!("{why}")), dumb };
    let mut entries = Vec::new();
    let mut note = |dive: &headrace_monitor::run::Loop| {
        entries.extend_from_slice(&dive.view().advised().entries);
    };
    drive(&mut dive, &mut feed, Pace { tick, ..Pace::default() }, &mut note).unwrap();
    dive.finish(&mut |_, _| {});
    Advised { entries, report: Report::of(&dive), digest: dive.view().digest() }
}

impl Advised {
    /// Advice updates in the second half of the dive.
    pub fn settled(&self) -> &[AdviceEntry] {
        &self.entries[self.entries.len() / 2..]
    }

    /// Median of a value over the advice updates in the second half of the dive.
    pub fn median(&self, of: impl Fn(&AdviceEntry) -> f64) -> f64 {
        let mut values: Vec<f64> = self.settled().iter().map(of).collect();
        values.sort_by(f64::total_cmp);
        values[values.len() / 2]
    }
}
