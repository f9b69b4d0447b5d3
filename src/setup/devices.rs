//! Devices for the vehicle file: those that answer a probe, and those that the user names.

use headrace_config::Document;
use headrace_config::plain::one_line;
use headrace_devices::KINDS;
use headrace_geometry::frames::{Mount, Rot, Vec3};
use headrace_geometry::time::DurNs;
use headrace_ports::{Answer, Found, Machine, OpenError, discover, same_device};
use headrace_sensor::SensorConfig;
use headrace_sensor::connect::{Connect, UsbIdentity};
use headrace_sensor::device::Device;
use headrace_sensor::driver::Carrier;

use super::questions::{Question, Questions};
use crate::cli::{GivenPort, Setup};
use crate::failure::Failure;
use crate::logging::complain;
use crate::output::say;
use crate::tunnel_option;

/// Number of probes of a port that the user names. A busy computer may miss an answer.
const ATTEMPTS: usize = 3;
/// Address of the depth sensor on an I2C bus. Source: plugins/bar100.
const DEPTH_SENSOR: &str = "0x40";

/// Keys that a kind of device requires: plugin, key, other keys that replace it, question.
const REQUIRED: [(&str, &str, &[&str], &str); 3] = [
    ("imu_can", "preset", &["dbc"], "xsens_mti600, sbg_ellipse, j1939 or bosch_mm5"),
    (
        "tether_hid",
        "counts_per_metre",
        &["preset", "kind"],
        "2000 for an encoder wheel, 100 for a magnet wheel",
    ),
    ("mavlink", "part", &[], "imu, pressure or distance"),
];

/// A device for the vehicle file.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct FoundDevice {
    pub(super) id: String,
    pub(super) plugin: &'static str,
    pub(super) connect: Connect,
    /// Identity that the device reports; empty if it wasn't probed.
    pub(super) identity: String,
    /// Keys of the device's kind, as lines of the vehicle file.
    pub(super) keys: String,
}

impl FoundDevice {
    fn new(plugin: &'static str, connect: Connect, identity: String) -> Self {
        // In the text of an identity, a part with an equals sign is a key of the vehicle file, such as "head_id =
        // 0x10".
        let is_key = |part: &&str| part.contains(" = ");
        let keys: Vec<&str> = identity.split(", ").filter(is_key).collect();
        let keys = keys.join("\n") + if keys.is_empty() { "" } else { "\n" };
        Self { id: String::new(), plugin, connect, identity, keys }
    }

    /// Value of a key of the device's kind, without quotation marks.
    pub(super) fn value(&self, key: &str) -> Option<&str> {
        let pairs = self.keys.lines().filter_map(|line| line.split_once(" = "));
        pairs.filter(|(known, _)| *known == key).map(|(_, value)| value.trim_matches('"')).next()
    }

    /// Whether the device's keys have this key.
    pub(super) fn has(&self, key: &str) -> bool {
        self.value(key).is_some()
    }

    /// The device with further keys. They replace keys that it has.
    fn with(mut self, keys: &[(String, String)]) -> Self {
        let is_given = |line: &&str| keys.iter().any(|(key, _)| line.split(" = ").next() == Some(key));
        let kept: String =
            self.keys.lines().filter(|line| !is_given(line)).flat_map(|line| [line, "\n"]).collect();
        self.keys = keys.iter().fold(kept, |kept, (key, value)| kept + &tunnel_option::line(key, value));
        self
    }

    /// The device, configured by its own keys and by the lines `more`.
    ///
    /// Errors: a key is missing or has a wrong value.
    pub(super) fn configured(&self, more: &str) -> Result<Box<dyn Device>, String> {
        let kind = KINDS.iter().find(|kind| kind.name() == self.plugin);
        let kind = kind.ok_or_else(|| format!("this build has no {}", self.plugin))?;
        let config = SensorConfig {
            id: self.id.clone(),
            plugin: self.plugin.to_owned(),
            connect: self.connect.to_string(),
            mount: Mount { position: Vec3::zero(), rotation: Rot::identity() },
            latency: DurNs::ZERO,
        };
        let text = format!("{}{more}", self.keys);
        let own = Document::new(self.plugin, &text).root().map_err(|error| error.to_string())?;
        kind.configure(&config, &own).map_err(|error| error.to_string())
    }
}

/// Finds the devices, and shows them.
///
/// Errors: there are none, or a port that the user names has no device that can be identified.
pub(super) fn find(args: &Setup, questions: &mut Questions) -> Result<Vec<FoundDevice>, Failure> {
    let mut devices = Vec::new();
    for port in &args.port {
        for device in given(port)? {
            add(device, &mut devices, questions)?;
        }
    }
    for found in discover(&Machine::ours()) {
        let is_given = |port: &GivenPort| found.connect.as_ref().is_some_and(|at| is_on(&port.connect, at));
        if args.port.iter().any(is_given) {
            continue;
        }
        for device in attached(&found, questions)? {
            add(device, &mut devices, questions)?;
        }
    }
    while questions.has_terminal() && !args.yes {
        let question = Question {
            text: "Another device, such as tcp:192.168.0.5:4040 or bar100=i2c:/dev/i2c-1:0x40 (Enter: none)",
            option: "--port",
            suggestion: Some(""),
        };
        let parse = |text: &str| if text.is_empty() { Ok(None) } else { GivenPort::parse(text).map(Some) };
        let Some(port) = questions.ask(&question, parse)?.flatten() else { break };
        match given(&port) {
            Ok(found) => {
                for device in found {
                    add(device, &mut devices, questions)?;
                }
            }
            Err(failure) => complain(&failure.to_string()),
        }
    }
    if devices.is_empty() {
        return Err(Failure::Required(
            "setup: no device is found; name ports with --port, and see headrace devices".to_owned(),
        ));
    }
    Ok(devices)
}

/// Adds a device: gives it an id, asks for a key that its kind requires, and shows it.
fn add(
    mut device: FoundDevice,
    devices: &mut Vec<FoundDevice>,
    questions: &mut Questions,
) -> Result<(), Failure> {
    device.id = id(device.plugin, devices);
    let identity = if device.identity.is_empty() { "not probed" } else { &device.identity };
    say(&one_line(&format!("{:<8} {:<12} {}: {identity}", device.id, device.plugin, device.connect)));
    require_keys(&mut device, questions)?;
    devices.push(device);
    Ok(())
}

/// Id of a further device. Heads and Pings are numbered, and so are other devices after the first of their kind.
fn id(plugin: &str, devices: &[FoundDevice]) -> String {
    let stem = match plugin {
        "imagenex881" => "sonar",
        "ping1d" => "ping",
        "bar100" => "depth",
        "imu_can" => "imu",
        "tether_hid" => "tether",
        "a50" => "dvl",
        other => other,
    };
    let earlier = devices.iter().filter(|device| device.plugin == plugin).count();
    let is_numbered = earlier > 0 || ["sonar", "ping"].contains(&stem);
    if is_numbered { format!("{stem}_{earlier}") } else { stem.to_owned() }
}

/// Whether a connection uses the port or bus that was found.
fn is_on(connect: &Connect, found: &str) -> bool {
    let text = connect.to_string();
    text == found
        || found.strip_suffix("ADDRESS").is_some_and(|bus| text.starts_with(bus))
        || Connect::parse(found).is_ok_and(|found| same_device(connect, &found))
}

/// The devices on a port that the user names.
fn given(port: &GivenPort) -> Result<Vec<FoundDevice>, Failure> {
    let at = &port.connect;
    let devices = if let Some(plugin) = port.plugin {
        vec![FoundDevice::new(plugin, at.clone(), String::new())]
    } else {
        let mut probed = Ok(Probed::default());
        for _ in 0..ATTEMPTS {
            probed = probe(at);
            if probed.as_ref().is_ok_and(Probed::has_answers) {
                break;
            }
        }
        let probed = probed.map_err(|error| Failure::Required(format!("setup: {error}")))?;
        probed.show_doubtful();
        if probed.devices.is_empty() {
            return Err(Failure::Required(format!(
                "setup: no device at {at} is known as an 881 head or Ping; check its power, or name its kind as PLUGIN={at}"
            )));
        }
        probed.devices
    };
    Ok(devices.into_iter().map(|device| device.with(&port.keys)).collect())
}

/// Shows that a device isn't in the vehicle file, and the reason.
fn left_out(connect: &Connect, why: &str) {
    say(&one_line(&format!("left out {connect}: {why}")));
}

/// The wanted devices on a port, bus or interface of this computer.
fn attached(found: &Found, questions: &mut Questions) -> Result<Vec<FoundDevice>, Failure> {
    let connect = found.connect.as_deref().map(|text| text.replace("ADDRESS", DEPTH_SENSOR));
    let Some(connect) = connect.and_then(|text| Connect::parse(&text).ok()) else { return Ok(Vec::new()) };
    let left_out = |why: &str| left_out(&connect, why);
    for trouble in &found.troubles {
        // CAN interfaces and HID devices may be added in spite of the problem.
        if matches!(found.carrier, Carrier::Can | Carrier::Hid) {
            complain(&format!("headrace: warning: {connect}: {trouble}"));
        } else {
            left_out(&trouble.to_string());
        }
    }
    let (plugin, kind, is_suggested) = match found.carrier {
        Carrier::Can => ("imu_can", "an inertial unit", true),
        Carrier::Hid => {
            ("tether_hid", "a cable counter", matches!(&connect, Connect::Hid(id) if is_reference(id)))
        }
        Carrier::I2c => {
            left_out("for a depth sensor, --port bar100=CONNECT");
            return Ok(Vec::new());
        }
        Carrier::Serial | Carrier::Tcp | Carrier::Udp => {
            if !found.troubles.is_empty() {
                return Ok(Vec::new());
            }
            let probed = probe(&connect);
            match &probed {
                Ok(probed) if probed.has_answers() => probed.show_doubtful(),
                Ok(_) => left_out("no 881 head or Ping answers; for another device, --port PLUGIN=CONNECT"),
                Err(error) => left_out(&error.to_string()),
            }
            return Ok(probed.map(|probed| probed.devices).unwrap_or_default());
        }
    };
    let says = found.says.as_deref().unwrap_or("unnamed");
    if questions.confirm(&format!("Is {kind} at {connect} ({says})?"), is_suggested)? {
        return Ok(vec![FoundDevice::new(plugin, connect, String::new())]);
    }
    left_out(&format!("if it is {kind}, --port {plugin}=CONNECT"));
    Ok(Vec::new())
}

/// Whether a HID device has the ids of the reference counter. Source: plugins/tether_hid.
fn is_reference(id: &UsbIdentity) -> bool {
    (id.vendor, id.product) == (0x1209, 0x0001)
}

/// Devices that answer probes of a port.
#[derive(Debug, Default)]
struct Probed {
    devices: Vec<FoundDevice>,
    /// Devices that may be of another kind than the probe's.
    doubtful: Vec<FoundDevice>,
}

impl Probed {
    fn has_answers(&self) -> bool {
        !self.devices.is_empty() || !self.doubtful.is_empty()
    }

    /// Shows the doubtful devices, and how to add them.
    fn show_doubtful(&self) {
        for FoundDevice { plugin, connect, identity, keys, .. } in &self.doubtful {
            let keys = keys.lines().fold(String::new(), |keys, line| keys + "," + &line.replace(" = ", "="));
            left_out(
                connect,
                &format!(
                    "{identity}; if it is of the kind {plugin}, name each device of this port, this one with --port \
                     {plugin}={connect}{keys}"
                ),
            );
        }
    }
}

/// Probes a port for all devices of one kind.
fn probe(connect: &Connect) -> Result<Probed, OpenError> {
    let mut probed = Probed::default();
    for kind in KINDS {
        for mut probe in kind.probes().into_iter().map(|probe| [probe]) {
            let Answer::Is(identity) = headrace_ports::probe(connect, &mut probe)? else { continue };
            let device = FoundDevice::new(kind.name(), connect.clone(), identity);
            let [probe] = probe;
            let list = if probe.is_of_kind() { &mut probed.devices } else { &mut probed.doubtful };
            list.push(device);
        }
        if probed.has_answers() {
            break;
        }
    }
    Ok(probed)
}

/// Asks for a key that the device's kind requires.
fn require_keys(device: &mut FoundDevice, questions: &mut Questions) -> Result<(), Failure> {
    for (plugin, key, others, values) in REQUIRED {
        if device.plugin != plugin || device.has(key) || others.iter().any(|other| device.has(other)) {
            continue;
        }
        let text = format!("{key} of {}: {values}", device.id);
        let option = format!("--port {plugin}={},{key}=... ({values})", device.connect);
        let question = Question { text: &text, option: &option, suggestion: None };
        let answer = questions.ask(&question, |answer| {
            let line = tunnel_option::line(key, answer);
            device.configured(&line).map(|_| line)
        })?;
        device.keys.extend(answer);
    }
    Ok(())
}
