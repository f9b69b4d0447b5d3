//! `headrace emulate`: a scene's devices emulated on real ports in real time.

use std::path::Path;

use headrace_config as config;
use headrace_config::Document;
use headrace_devices::KINDS;
use headrace_geometry::time::{DurNs, MonoNs};
use headrace_ports::{EmulatedPort, wait_for_any};
use headrace_sensor::connect::Connect;
use headrace_sensor::device::Direction;
use headrace_sensor::driver::Carrier;
use headrace_simulator::{START, Scene, Simulation};

use crate::cli::Emulate;
use crate::failure::{self, Failure};
use crate::files::{self, Beside};
use crate::live::connections;
use crate::logging::complain;
use crate::output::say;
use crate::outputs::{self, Claims, Kind, REHEARSAL};

/// Longest wait for bytes from a host, ns. It limits the delay of a measurement.
const WAIT_NS: u32 = 1_000_000;

/// Runs `headrace emulate`.
pub(crate) fn emulate(args: &Emulate) -> Result<u8, Failure> {
    let (name, text) = (args.scene.display().to_string(), files::read(&args.scene)?);
    let beside = Beside::of(&args.scene);
    let load = |name: &str| beside.load(name);
    let scene = Scene::parse(Document::new(&name, &text), &KINDS, &load, args.seed)?;
    if scene.is_advised() {
        return Err(Failure::Usage(format!(
            "emulate: {name} has a pilot who follows advice, which hosts don't send; simulate it instead"
        )));
    }
    let vehicle_file = args.out.join("vehicle.toml");
    claim(&scene, args, &vehicle_file, &beside)?;
    let stands = stands(&scene, args)?;
    write_vehicle(&scene, &stands, &args.out, &vehicle_file)?;
    for (config, stand) in scene.vehicle.sensor_configs.iter().zip(&stands) {
        say(&format!("{:<12} {}", config.id, stand.connect()));
    }
    say(&format!("vehicle {}", vehicle_file.display()));
    let mut rehearsal =
        Rehearsal { simulation: Simulation::for_hosts(&scene)?, stands, origin: headrace_ports::now() };
    rehearsal.run(args)?;
    Ok(failure::OK)
}

/// Checks that the vehicle file and the files that it refers to can be written.
fn claim(scene: &Scene, args: &Emulate, vehicle_file: &Path, beside: &Beside) -> Result<(), Failure> {
    outputs::folder(&args.out)?;
    let mut claims = Claims::reading(beside.files(), &args.overwrite);
    claims.claim("--out", vehicle_file, Kind::Rehearsal)?;
    for (name, content) in &scene.vehicle.attachments {
        let path = args.out.join(name);
        if let Some(parent) = path.parent() {
            outputs::folder(parent)?;
        }
        if !holds(&path, content) {
            claims.claim("--out", &path, Kind::Rehearsal)?;
        }
    }
    Ok(())
}

/// Whether a file equals one that an earlier rehearsal has written. Such a file may be overwritten.
fn holds(path: &Path, content: &str) -> bool {
    std::fs::read(path).is_ok_and(|there| there == content.as_bytes())
}

/// Opens a port for each sensor. The port's carrier is that of `connect`, or UDP if this machine doesn't have
/// that carrier.
fn stands(scene: &Scene, args: &Emulate) -> Result<Vec<EmulatedPort>, Failure> {
    let mut stands = Vec::new();
    for ((id, asked), device) in connections(&scene.vehicle).into_iter().zip(&scene.vehicle.sensors) {
        let carrier = asked.as_ref().map_or(Carrier::Udp, Connect::carrier);
        let stand = match (asked, device.report_descriptor()) {
            (Ok(Connect::Hid(identity)), Some(descriptor)) => EmulatedPort::hid(&identity, &descriptor),
            #[cfg(target_os = "linux")]
            (Ok(Connect::Can { interface }), _) if headrace_ports::is_interface_up(&interface) => {
                EmulatedPort::can(&interface)
            }
            _ => EmulatedPort::new(carrier, args.listen),
        };
        let stand = stand.or_else(|error| {
            complain(&format!(
                "headrace: {id}: no {} on this machine ({error}); using UDP",
                carrier.as_str()
            ));
            EmulatedPort::new(Carrier::Udp, args.listen)
        });
        stands.push(stand.map_err(|source| Failure::System { what: "opening a port for a device", source })?);
    }
    Ok(stands)
}

/// Writes the vehicle file and the files that it refers to.
fn write_vehicle(scene: &Scene, stands: &[EmulatedPort], folder: &Path, file: &Path) -> Result<(), Failure> {
    let ids = scene.vehicle.sensor_configs.iter().map(|config| &config.id);
    let changed =
        ids.zip(stands).map(|(id, stand)| format!("sensors.{id}.connect = \"{}\"\n", stand.connect()));
    let changes: String = changed.collect();
    let section = Document::new("rehearsal", &changes).root()?;
    let text = config::changed(&with_connects(scene), &section)?;
    for (name, content) in &scene.vehicle.attachments {
        let path = folder.join(name);
        if !holds(&path, content) {
            files::write(&path, content.as_bytes())?;
        }
    }
    let text = format!("{REHEARSAL}{}\n{text}", scene.name.replace('\n', " "));
    files::write(file, text.as_bytes())
}

/// The scene's vehicle file, with a `connect` in each sensor's table.
///
/// A file for simulations may have none.
fn with_connects(scene: &Scene) -> String {
    let missing: Vec<String> = scene
        .vehicle
        .sensor_configs
        .iter()
        .filter(|config| config.connect.is_empty())
        .map(|config| format!("\"{}\"", config.id))
        .collect();
    let mut text = String::new();
    for line in scene.vehicle_text.lines() {
        text.push_str(line);
        let key_and_value = line.split('#').next().and_then(|line| line.split_once('='));
        let names =
            |(key, value): (&str, &str)| key.trim() == "id" && missing.iter().any(|id| value.trim() == id);
        if key_and_value.is_some_and(names) {
            text.push_str("\nconnect = \"\"");
        }
        text.push('\n');
    }
    text
}

/// The simulated devices and their ports.
struct Rehearsal {
    simulation: Simulation,
    stands: Vec<EmulatedPort>,
    /// Time on this machine's clock at which the simulation started.
    origin: MonoNs,
}

impl Rehearsal {
    fn run(&mut self, args: &Emulate) -> Result<(), Failure> {
        let mut called = vec![false; self.stands.len()];
        while called.contains(&false) {
            self.go_on()?;
            for (called, stand) in called.iter_mut().zip(&self.stands) {
                *called |= stand.is_called();
            }
        }
        let sets_out = self.now() + DurNs::from_secs_f64(args.stand);
        self.simulation.set_out(sets_out);
        say(&format!("all sensors are connected; starting in {} s", args.stand));
        let end = self.simulation.end();
        self.go_on_until(end)?;
        say("end of the trajectory");
        self.go_on_until(end + DurNs::from_secs_f64(args.linger))
    }

    fn now(&self) -> MonoNs {
        START + headrace_ports::now().since(self.origin)
    }

    fn go_on_until(&mut self, end: MonoNs) -> Result<(), Failure> {
        while self.now() < end {
            self.go_on()?;
        }
        Ok(())
    }

    /// Passes bytes from the ports to the simulated devices, and the devices' bytes that are due to the
    /// ports.
    fn go_on(&mut self) -> Result<(), Failure> {
        let failed = |source| Failure::System { what: "emulating a device on its port", source };
        wait_for_any(&self.stands, WAIT_NS);
        let now = self.now();
        for (number, stand) in self.stands.iter_mut().enumerate() {
            while let Some(bytes) = stand.read().map_err(failed)? {
                self.simulation.hear(number, now, &bytes);
            }
        }
        self.simulation.go_on(now + DurNs(1));
        while let Some(message) = self.simulation.waiting_message() {
            let stand = self.stands.get_mut(usize::from(message.source));
            if let Some(stand) = stand.filter(|_| message.direction == Direction::Received) {
                stand.write(message.bytes).map_err(failed)?;
            }
        }
        Ok(())
    }
}
