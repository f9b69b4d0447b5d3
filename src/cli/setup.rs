//! Options of `setup`.

use std::path::PathBuf;

use clap::Args;
use headrace_devices::KINDS;
use headrace_sensor::connect::Connect;
use headrace_sensor::device::DeviceKind;

use super::common_options::Overwrite;
use super::value_parsers::{length, target};

#[derive(Debug, Args)]
pub(crate) struct Setup {
    /// Vehicle file to write.
    #[arg(short, long, value_name = "VEHICLE.toml", default_value = "vehicle.toml")]
    pub(crate) out: PathBuf,
    /// Tunnel profile by name with dimensions as in a vehicle file (circle,radius_m=3), or a polyline file (.csv)
    /// beside the vehicle file.
    #[arg(long, value_name = "TUNNEL")]
    pub(crate) tunnel: Option<String>,
    /// Length of the tunnel, metres.
    #[arg(long, value_name = "METRES", value_parser = length)]
    pub(crate) length: Option<f64>,
    /// Target T, metres.
    #[arg(long, value_name = "METRES", value_parser = target)]
    pub(crate) target: Option<f64>,
    /// Port of a device, besides those found. Without a plugin it is probed for an 881 head or a Ping. May be
    /// given several times.
    #[arg(long, value_name = "[PLUGIN=]CONNECT[,KEY=VALUE]..", value_parser = GivenPort::parse)]
    pub(crate) port: Vec<GivenPort>,
    /// Mount of a device: metres forward, left and up from the vehicle's origin, and its direction: ahead, aft,
    /// left, right, up or down. Instead: roll, pitch and yaw, degrees, at the origin. May be given several times.
    #[arg(long, value_name = "ID=X,Y,Z,DIRECTION", value_parser = mount_of)]
    pub(crate) mount: Vec<(String, [[f64; 3]; 2])>,
    /// Take the suggested answers instead of asking: CAN interfaces are inertial units, and the HID device
    /// 1209:0001 is a cable counter.
    #[arg(short, long)]
    pub(crate) yes: bool,
    #[command(flatten)]
    pub(crate) overwrite: Overwrite,
}

/// A port given on the command line.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct GivenPort {
    /// Kind of device on the port; `None` if the port is to be probed.
    pub(crate) plugin: Option<&'static str>,
    pub(crate) connect: Connect,
    /// Further keys of the sensor's table in the vehicle file, each with its value.
    pub(crate) keys: Vec<(String, String)>,
}

impl GivenPort {
    /// Reads `[PLUGIN=]CONNECT[,KEY=VALUE]..`.
    ///
    /// Errors: the plugin is unknown, or the text has another form.
    pub(crate) fn parse(text: &str) -> Result<Self, String> {
        let mut parts = text.split(',');
        let first = parts.next().unwrap_or_default();
        // An equals sign after the colon belongs to the connection, not to a plugin's name.
        let named = first.split_once('=').filter(|(plugin, _)| !plugin.contains(':'));
        let plugin = named.map(|(plugin, _)| plugin_named(plugin)).transpose()?;
        let connect =
            Connect::parse(named.map_or(first, |(_, connect)| connect)).map_err(|error| error.to_string())?;
        let key = |part: &str| match part.split_once('=') {
            Some((key, value)) => Ok((key.trim().to_owned(), value.trim().to_owned())),
            None => Err(format!("expected KEY=VALUE after the comma, not {part:?}")),
        };
        Ok(Self { plugin, connect, keys: parts.map(key).collect::<Result<_, _>>()? })
    }
}

fn plugin_named(name: &str) -> Result<&'static str, String> {
    let names = KINDS.map(DeviceKind::name);
    let found = names.into_iter().find(|known| *known == name);
    found.ok_or_else(|| format!("unknown plugin {name:?}; expected one of {}", names.join(", ")))
}

fn mount_of(text: &str) -> Result<(String, [[f64; 3]; 2]), String> {
    let (id, place) =
        text.split_once('=').ok_or("expected ID=X,Y,Z,DIRECTION, such as sonar_0=0.3,0,0,ahead")?;
    Ok((id.trim().to_owned(), mount(place)?))
}

/// Largest coordinate of a sensor, m, as in a vehicle file.
const FARTHEST_M: f64 = 20.0;
/// Largest angle of a sensor, degrees, as in a vehicle file.
const MOST_DEGREES: f64 = 360.0;
/// Directions of a sensor's x axis, as roll, pitch and yaw in degrees.
const DIRECTIONS: [(&str, [f64; 3]); 6] = [
    ("ahead", [0.0, 0.0, 0.0]),
    ("aft", [0.0, 0.0, 180.0]),
    ("left", [0.0, 0.0, 90.0]),
    ("right", [0.0, 0.0, -90.0]),
    ("up", [0.0, -90.0, 0.0]),
    ("down", [0.0, 90.0, 0.0]),
];

/// Position, metres, and roll, pitch and yaw, degrees, of a sensor: `X,Y,Z,DIRECTION`, or `ROLL,PITCH,YAW` at the origin.
pub(crate) fn mount(text: &str) -> Result<[[f64; 3]; 2], String> {
    let parts: Vec<&str> = text.split(',').map(str::trim).collect();
    if let [roll, pitch, yaw] = parts[..] {
        let degrees = |part: &str| {
            let degrees = part.parse().ok().filter(|degrees: &f64| degrees.abs() <= MOST_DEGREES);
            degrees.ok_or_else(|| {
                format!("{part:?} isn't a number from -{MOST_DEGREES} to {MOST_DEGREES} degrees")
            })
        };
        return Ok([[0.0; 3], [degrees(roll)?, degrees(pitch)?, degrees(yaw)?]]);
    }
    let [x, y, z, direction] = parts[..] else {
        return Err("expected X,Y,Z,DIRECTION, such as 0.3,0,-0.1,ahead, or ROLL,PITCH,YAW".to_owned());
    };
    let metres = |part: &str| {
        let metres = part.parse().ok().filter(|metres: &f64| metres.abs() <= FARTHEST_M);
        metres.ok_or_else(|| format!("{part:?} isn't a number from -{FARTHEST_M} to {FARTHEST_M} metres"))
    };
    let known = DIRECTIONS.iter().find(|(known, _)| *known == direction);
    let names = || DIRECTIONS.map(|(name, _)| name).join(", ");
    let (_, angles) =
        known.ok_or_else(|| format!("{direction:?} isn't a direction; expected one of {}", names()))?;
    Ok([[metres(x)?, metres(y)?, metres(z)?], *angles])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mounts_have_a_position_and_a_direction() {
        assert_eq!(mount("0.3, 0,-0.1,aft"), Ok([[0.3, 0.0, -0.1], [0.0, 0.0, 180.0]]));
        assert_eq!(mount("0,30,0,up"), Err("\"30\" isn't a number from -20 to 20 metres".to_owned()));
        assert_eq!(mount("180,0,-90.5"), Ok([[0.0; 3], [180.0, 0.0, -90.5]]));
        assert_eq!(mount("0,0,361"), Err("\"361\" isn't a number from -360 to 360 degrees".to_owned()));
        for text in ["", "0,0", "0,0,up", "0,0,0,forwards", "0,nan,0,up"] {
            assert!(mount(text).is_err(), "{text}");
        }
    }

    #[test]
    fn ports_have_a_connection_and_optionally_plugin_and_keys() {
        let serial = GivenPort::parse("serial:/dev/ttyS0?baud=9600").unwrap();
        assert_eq!(
            (serial.plugin, serial.connect.to_string().as_str()),
            (None, "serial:/dev/ttyS0?baud=9600")
        );
        let counter = GivenPort::parse("tether_hid=serial:/dev/ttyS1?baud=9600,kind=lci90,unit=m").unwrap();
        assert_eq!(counter.plugin, Some("tether_hid"));
        let key = |key: &str, value: &str| (key.to_owned(), value.to_owned());
        assert_eq!(counter.keys, [key("kind", "lci90"), key("unit", "m")]);
        for (text, words) in [
            ("sonar=tcp:h:1", "unknown plugin \"sonar\"; expected one of imagenex881, "),
            ("bar100=i2c", "there is no colon; allowed are serial:"),
            ("tcp:h:1,mode", "expected KEY=VALUE"),
        ] {
            let error = GivenPort::parse(text).unwrap_err();
            assert!(error.contains(words), "{error}");
        }
    }
}
