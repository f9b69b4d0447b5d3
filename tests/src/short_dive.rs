//! Files of a small vehicle and a short dive.

/// Two heads in a circular tunnel, with all sensors for the position.
pub const VEHICLE: &str = r#"name = "test vehicle"
target_m = 1.2

[tunnel]
profile = "circle"
radius_m = 3
length_m = 100

[water]
sound_speed_mps = 1447

[heads]
planned_speed_mps = 0.2

[[sensors]]
id = "sonar_0"
plugin = "imagenex881"
connect = "tcp:192.168.0.4:4040"
mode = "fastest"
range_m = 5

[[sensors]]
id = "sonar_1"
plugin = "imagenex881"
connect = "tcp:192.168.0.5:4040"
mode = "fastest"
range_m = 5

[[sensors]]
id = "ping_left"
plugin = "ping1d"
angles_deg = [0, 0, 90]

[[sensors]]
id = "ping_right"
plugin = "ping1d"
angles_deg = [0, 0, -90]

[[sensors]]
id = "ping_up"
plugin = "ping1d"
angles_deg = [0, -90, 0]

[[sensors]]
id = "ping_down"
plugin = "ping1d"
angles_deg = [0, 90, 0]

[[sensors]]
id = "depth"
plugin = "bar100"

[[sensors]]
id = "imu"
plugin = "imu_can"
preset = "xsens_mti600"

[[sensors]]
id = "tether"
plugin = "tether_hid"
counts_per_metre = 2000
"#;

/// An autopilot with six sensor tables that share one line, and a velocity log.
const OTHER_SENSORS: &str = r#"
[[sensors]]
id = "imu"
plugin = "mavlink"
connect = "udp:0.0.0.0:14550"
part = "imu"
rate_hz = 100

[[sensors]]
id = "depth"
plugin = "mavlink"
connect = "udp:0.0.0.0:14550"
part = "pressure"

[[sensors]]
id = "left"
plugin = "mavlink"
connect = "udp:0.0.0.0:14550"
part = "distance"
sensor_id = 1
angles_deg = [0, 0, 90]

[[sensors]]
id = "right"
plugin = "mavlink"
connect = "udp:0.0.0.0:14550"
part = "distance"
sensor_id = 2
angles_deg = [0, 0, -90]

[[sensors]]
id = "up"
plugin = "mavlink"
connect = "udp:0.0.0.0:14550"
part = "distance"
sensor_id = 3
angles_deg = [0, -90, 0]

[[sensors]]
id = "down"
plugin = "mavlink"
connect = "udp:0.0.0.0:14550"
part = "distance"
sensor_id = 4
angles_deg = [0, 90, 0]

[[sensors]]
id = "dvl"
plugin = "a50"
connect = "tcp:192.168.194.95:16171"
position_m = [-0.2, 0.1, -0.1]
angles_deg = [0, 0, 20]

[[sensors]]
id = "tether"
plugin = "tether_hid"
counts_per_metre = 2000
"#;

/// The two heads on a vehicle with all other sensors on an autopilot.
pub fn other_vehicle() -> String {
    let heads = VEHICLE.split("[[sensors]]\nid = \"ping_left\"").next().unwrap();
    format!("{heads}{OTHER_SENSORS}")
}

/// A dive of 20 s over 4 m. No head sees parts of the last metre from both sides.
pub const SCENE: &str = r#"name = "short dive"
vehicle = "vehicle.toml"

[trajectory]
start_m = 3

[[trajectory.legs]]
distance_m = 4
speed_mps = 0.2
"#;
