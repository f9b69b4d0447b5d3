//! Replays a dive log through the loop and prints each judged section of the wall.
//!
//! Run: `cargo run --example read_log [LOG.mcap]`; without a log it uses a golden log.

use std::error::Error;
use std::path::PathBuf;

use headrace_config::Document;
use headrace_devices::KINDS;
use headrace_monitor::App;
use headrace_monitor::pilot_text::station;
use headrace_replay::drive::{Pace, drive};
use headrace_replay::log::files_of;
use headrace_replay::player::Player;
use headrace_vehicle::VehicleConfig;

const GOLDEN: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/golden/steel.mcap");

fn main() -> Result<(), Box<dyn Error>> {
    let log = std::env::args_os().nth(1).map_or_else(|| PathBuf::from(GOLDEN), PathBuf::from);
    let mut player = Player::open(&files_of(&[log])?)?;

    // The log has the vehicle file, and all files named in it, as attachments.
    let info = player.info();
    let text = info.vehicle_toml.clone().ok_or("no vehicle file is attached to this log")?;
    let attached = |name: &str| {
        let content = info.attachments.iter().find(|(attached, _)| attached == name);
        let (_, content) = content.ok_or_else(|| "is not attached to the log".to_owned())?;
        String::from_utf8(content.clone()).map_err(|error| error.to_string())
    };
    let vehicle = VehicleConfig::parse(Document::new("vehicle.toml", &text), &KINDS, &attached)?;

    let mut app = App::new(vehicle.mission());
    for sensor in &vehicle.sensors {
        app.add_device(sensor.as_ref())?;
    }
    let mut dive = app.arm(vehicle.navigation())?;
    player.connect(dive.sources());
    drive(&mut dive, &mut player, Pace::default(), &mut |_| ())?;
    // Ends the dive, which also judges the last sections. Until then they are open, because later samples
    // could change them.
    dive.finish(&mut |_, _| ());

    println!("{}, target {} m", vehicle.name, vehicle.target.max_hole_m);
    println!("{:>10}  {:>8}  {:>6}  verdict", "from", "hole m", "sd m");
    let sections = &dive.view().coverage().sections;
    let first = sections.index_of(0.0);
    for index in (first..).take(sections.len()) {
        let Some(section) = sections.get(index) else { continue };
        let Some(hole) = section.hole else { continue };
        let from = station(sections.bounds_m(index).0);
        // The diameter is only a lower bound if the hole has no samples all around it.
        let diameter = format!("{}{:.3}", if hole.bounded { "" } else { ">" }, hole.diameter_m);
        println!("{from:>10}  {diameter:>8}  {:>6.3}  {}", section.hole_sd_m, section.verdict.as_str());
    }
    for loss in player.losses() {
        println!("lost: {loss}");
    }
    Ok(())
}
