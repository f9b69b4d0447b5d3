//! `headrace emulate`: a scene's devices emulated on real ports in real time.

mod controls;
mod stand;

use std::path::Path;

use crossbeam::channel::Receiver;
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
use crate::tui::keys::{Key, keys};
use controls::{Change, Input, Order, order, say_keys};
use stand::{OFF, Stand};

/// Longest wait for bytes from a host, ns. It limits the delay of a measurement.
const WAIT_NS: u32 = 1_000_000;
/// Delays of a device's data that the key for delays selects in turn.
const DELAYS: [DurNs; 3] = [DurNs(500_000_000), DurNs(2_000_000_000), DurNs(10_000_000_000)];

/// Time for which the key for holding back stops the data of all devices.
const HELD: DurNs = DurNs(1_300_000_000);

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
        say(&format!("{:<12} {}", config.id, stand.connect));
    }
    say(&format!("vehicle {}", vehicle_file.display()));
    let simulation = Simulation::for_hosts(&scene)?;
    let (inputs, keyboard) = controls::listen()?;
    if let Some(first) = stands.first().filter(|_| keyboard.is_some()) {
        tell(&first.id, "chosen");
    }
    let mut rehearsal = Rehearsal {
        scene: &scene,
        simulation,
        stands,
        origin: headrace_ports::now(),
        inputs,
        chosen: 0,
        is_frozen: false,
        is_ended: false,
    };
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

/// Whether a file has this content, as written by an earlier rehearsal. Such a file may be overwritten.
fn holds(path: &Path, content: &str) -> bool {
    std::fs::read(path).is_ok_and(|there| there == content.as_bytes())
}

/// Opens a port for each sensor. The port has the carrier (serial, TCP, CAN, ...) that `connect` names, or UDP if this
/// machine lacks that carrier.
fn stands(scene: &Scene, args: &Emulate) -> Result<Vec<Stand>, Failure> {
    let mut stands = Vec::new();
    for ((id, asked), device) in connections(&scene.vehicle).into_iter().zip(&scene.vehicle.sensors) {
        let carrier = asked.as_ref().map_or(Carrier::Udp, Connect::carrier);
        let descriptor = device.report_descriptor();
        let port = match (asked, &descriptor) {
            (Ok(Connect::Hid(identity)), Some(descriptor)) => EmulatedPort::hid(&identity, descriptor),
            #[cfg(target_os = "linux")]
            (Ok(Connect::Can { interface }), _) if headrace_ports::is_interface_up(&interface) => {
                EmulatedPort::can(&interface)
            }
            _ => EmulatedPort::new(carrier, args.listen),
        };
        let port = port.or_else(|error| {
            complain(&format!(
                "headrace: {id}: no {} on this machine ({error}); using UDP",
                carrier.as_str()
            ));
            EmulatedPort::new(Carrier::Udp, args.listen)
        });
        let port = port.map_err(|source| Failure::System { what: "opening a port for a device", source })?;
        stands.push(Stand::new(id, port, descriptor, &args.out));
    }
    Ok(stands)
}

/// Writes the vehicle file and the other files that it refers to.
fn write_vehicle(scene: &Scene, stands: &[Stand], folder: &Path, file: &Path) -> Result<(), Failure> {
    let ids = scene.vehicle.sensor_configs.iter().map(|config| &config.id);
    let changed =
        ids.zip(stands).map(|(id, stand)| format!("sensors.{id}.connect = \"{}\"\n", stand.connect));
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
/// A vehicle file for simulations may have no `connect`.
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
struct Rehearsal<'a> {
    scene: &'a Scene,
    simulation: Simulation,
    stands: Vec<Stand>,
    /// Time on this machine's clock at which the simulation started.
    origin: MonoNs,
    inputs: Receiver<Input>,
    /// Number of the device to which the keys apply.
    chosen: usize,
    is_frozen: bool,
    is_ended: bool,
}

impl Rehearsal<'_> {
    fn run(&mut self, args: &Emulate) -> Result<(), Failure> {
        let mut called = vec![false; self.stands.len()];
        while called.contains(&false) && !self.is_ended {
            self.go_on()?;
            for (called, stand) in called.iter_mut().zip(&self.stands) {
                *called |= stand.port.as_ref().is_some_and(EmulatedPort::is_called);
            }
        }
        let sets_out = self.now() + DurNs::from_secs_f64(args.stand);
        self.simulation.set_out(sets_out);
        if !self.is_ended {
            say(&format!("all sensors are connected; starting in {} s", args.stand));
        }
        let end = self.simulation.end();
        self.go_on_until(end)?;
        say(if self.is_ended { "ended early" } else { "end of the trajectory" });
        self.go_on_until(end + DurNs::from_secs_f64(args.linger))
    }

    fn now(&self) -> MonoNs {
        START + headrace_ports::now().since(self.origin)
    }

    fn go_on_until(&mut self, end: MonoNs) -> Result<(), Failure> {
        while self.now() < end && !self.is_ended {
            self.go_on()?;
        }
        Ok(())
    }

    /// Passes bytes from the ports to the simulated devices, and bytes of the devices to the ports when they are due.
    fn go_on(&mut self) -> Result<(), Failure> {
        let failed = |source| Failure::System { what: "emulating a device on its port", source };
        wait_for_any(self.stands.iter().filter_map(|stand| stand.port.as_ref()), WAIT_NS);
        while let Ok(input) = self.inputs.try_recv() {
            self.take(&input);
        }
        self.switch_on();
        let now = self.now();
        for (number, stand) in self.stands.iter_mut().enumerate() {
            stand.send_late(now).map_err(failed)?;
            while let Some(bytes) = stand.read().map_err(failed)? {
                self.simulation.hear(number, now, &bytes);
            }
        }
        self.simulation.go_on(now + DurNs(1));
        while let Some(message) = self.simulation.waiting_message() {
            let stand = self.stands.get_mut(usize::from(message.source));
            if let Some(stand) = stand.filter(|_| message.direction == Direction::Received) {
                stand.send(now, message.bytes).map_err(failed)?;
            }
        }
        Ok(())
    }

    /// Switches on the restarted devices whose time without power is over. A device then has the state of power-on.
    fn switch_on(&mut self) {
        let now = self.now();
        for (number, stand) in self.stands.iter_mut().enumerate() {
            match stand.switch_on(now) {
                Ok(false) => {}
                Ok(true) => {
                    self.simulation.restart(self.scene, number);
                    tell(&stand.id, "on again");
                }
                Err(error) => complain(&format!("headrace: {} can't be switched on: {error}", stand.id)),
            }
        }
    }

    fn take(&mut self, input: &Input) {
        match input {
            Input::Keys(bytes) => keys(bytes).into_iter().for_each(|key| self.press(key)),
            Input::Line(line) => {
                let ids: Vec<&str> = self.stands.iter().map(|stand| stand.id.as_str()).collect();
                match order(line, &ids) {
                    Ok(order) => self.obey(order),
                    Err(why) => complain(&format!("headrace: {why}")),
                }
            }
        }
    }

    fn press(&mut self, key: Key) {
        let (count, chosen) = (self.stands.len(), self.chosen);
        let Some(stand) = self.stands.get(chosen) else { return };
        let change = match key {
            Key::Up | Key::Down => {
                self.chosen = (chosen + if key == Key::Up { count - 1 } else { 1 }) % count;
                let id = self.stands.get(self.chosen).map_or("", |stand| stand.id.as_str());
                return tell(id, "chosen");
            }
            Key::Character('u') if stand.port.is_some() => Change::Unplug,
            Key::Character('u') => Change::Plug,
            Key::Character('s') if stand.is_stalled => Change::Resume,
            Key::Character('s') => Change::Stall,
            Key::Character('d') => Change::Delay(next_delay(stand.delay)),
            Key::Character('r') => Change::Restart,
            Key::Character('f') => return self.obey(Order::Freeze(!self.is_frozen)),
            Key::Character('b') => return self.obey(Order::Hold(HELD)),
            // Ctrl-C and Ctrl-D also end the rehearsal.
            Key::Character('q' | 'Q' | '\x03' | '\x04') => return self.obey(Order::End),
            Key::Character('?' | 'h') => return say_keys(),
            _ => return,
        };
        self.obey(Order::Device(chosen, change));
    }

    fn obey(&mut self, order: Order) {
        match order {
            Order::End => self.is_ended = true,
            Order::Freeze(is_frozen) => {
                self.is_frozen = is_frozen;
                let text = if is_frozen { "count frozen" } else { "counts again" };
                let counters = self.simulation.freeze_counters(is_frozen);
                if counters.is_empty() {
                    complain("headrace: this vehicle has no cable counter to freeze");
                }
                for number in counters {
                    tell(self.stands.get(number).map_or("", |stand| stand.id.as_str()), text);
                }
            }
            Order::Hold(duration) => {
                let until = self.now() + duration;
                self.stands.iter_mut().for_each(|stand| stand.hold(until));
                tell("all devices", &format!("data held back for {} s", duration.as_secs_f64()));
            }
            Order::Device(number, change) => {
                let now = self.now();
                if let Some(stand) = self.stands.get_mut(number) {
                    apply(stand, change, now);
                }
            }
        }
    }
}

/// Changes a device, and shows the change.
fn apply(stand: &mut Stand, change: Change, now: MonoNs) {
    let text = match change {
        Change::Unplug => {
            stand.unplug();
            "unplugged".to_owned()
        }
        Change::Plug => match stand.plug() {
            Ok(()) => "plugged in".to_owned(),
            Err(error) => return complain(&format!("headrace: {} can't be plugged in: {error}", stand.id)),
        },
        Change::Stall => {
            stand.is_stalled = true;
            "stalled: it doesn't answer".to_owned()
        }
        Change::Resume => {
            stand.is_stalled = false;
            "answers again".to_owned()
        }
        Change::Delay(delay) => {
            stand.delay = delay;
            let on_time = delay == DurNs(0);
            if on_time { "data on time".to_owned() } else { format!("data {} s late", delay.as_secs_f64()) }
        }
        Change::Restart => {
            stand.switch_off(now);
            format!("restarts: off for {} s", OFF.as_secs_f64())
        }
    };
    tell(&stand.id, &text);
}

/// Shows a change of a device.
fn tell(id: &str, text: &str) {
    say(&format!("{id:<12} {text}"));
}

/// Delay that the key for delays selects after the delay `delay`.
fn next_delay(delay: DurNs) -> DurNs {
    DELAYS.into_iter().find(|next| *next > delay).unwrap_or(DurNs(0))
}
