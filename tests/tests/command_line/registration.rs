//! A loop accepts each sensor only once. The report counts the readings that a decoder withheld.

use headrace_config::Document;
use headrace_fusion::direct::DirectNavigation;
use headrace_geometry::frames::{Mount, Rot, Vec3};
use headrace_geometry::site::Site;
use headrace_geometry::time::{DurNs, MonoNs};
use headrace_geometry::tunnel::shapes;
use headrace_monitor::App;
use headrace_monitor::PluginError;
use headrace_monitor::report::Report;
use headrace_sensor::SensorConfig;
use headrace_sensor::device::{Device, DeviceKind};
use headrace_vehicle::Mission;

fn app() -> App {
    App::new(Mission::new(shapes::circle(2.5).unwrap(), 0.5))
}

fn device(kind: &dyn DeviceKind, connect: &str, keys: &str) -> Box<dyn Device> {
    let sensor = SensorConfig {
        id: "sensor".to_owned(),
        plugin: kind.name().to_owned(),
        connect: connect.to_owned(),
        mount: Mount { position: Vec3::zero(), rotation: Rot::identity() },
        latency: DurNs::from_millis(2),
    };
    kind.configure(&sensor, &Document::new("v.toml", keys).root().unwrap()).unwrap()
}

#[test]
fn sensor_can_be_added_to_a_loop_only_once() {
    for device in [
        device(
            &headrace_imagenex881::Imagenex881Kind,
            "tcp:10.0.0.5:4040",
            "mode = \"fastest\"\nrange_m = 5\n",
        ),
        device(&headrace_ping1d::Ping1dKind, "udp:10.0.0.6:9090", ""),
    ] {
        let mut app = app();
        assert!(app.add_device(device.as_ref()).is_ok());
        let again = app.add_device(device.as_ref());
        assert_eq!(again, Err(PluginError::DuplicateSource { id: "sensor".to_owned() }));
    }
}

#[test]
fn report_counts_withheld_readings() {
    let mut app = app();
    app.add_device(device(&headrace_bar100::Bar100Kind, "i2c:/dev/i2c-1:0x40", "").as_ref()).unwrap();
    let navigation = DirectNavigation::new(shapes::circle(2.5).unwrap(), Site::default());
    let mut armed = app.arm(Box::new(navigation)).unwrap();
    let mut port = armed.take_port(0).unwrap();
    port.send(MonoNs(1), &[0xAC, 0x40, 0x46, 0x46, 0x4F, 0xA0]).unwrap();
    armed.tick(MonoNs(2));
    let source = &Report::of(&armed).sources[0];
    assert_eq!((source.frames, source.readings, source.withheld), (1, 0, 1));
}
