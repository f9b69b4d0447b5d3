//! `headrace devices`: lists attached devices and permissions, and with `--probe` their answers.

mod probing;
mod state;
mod text;

use headrace_ports::{Machine, OpenError, Presence, discover, presence};
use headrace_sensor::connect::Connect;
use headrace_vehicle::VehicleConfig;

use crate::cli::Devices;
use crate::failure::Failure;
use crate::live;
use crate::output::{deliver, show};
use crate::vehicle_file;
use state::{Inventory, Sensor, State};

/// Lists the attached devices.
///
/// The exit code is 1 if a sensor's port is missing, may not be opened, or doesn't answer.
pub(crate) fn devices(args: &Devices) -> Result<u8, Failure> {
    let machine = Machine::ours();
    let vehicle = args.vehicle.as_ref().map(|path| vehicle_file::read(path)).transpose()?;
    let found = discover(&machine);
    let found = found.into_iter().map(|found| {
        let probed = args.probe.then(|| probing::port(&found)).flatten();
        (found, probed)
    });
    let found = found.collect();
    let addresses = args.address.iter().map(|connect| (connect.clone(), probing::address(connect)));
    let addresses = addresses.collect();
    let sensors = vehicle.map(|(_, vehicle)| sensors(&machine, &vehicle, args.probe));
    let inventory = Inventory { found, addresses, sensors };
    if args.json {
        deliver(&inventory.json().to_string())?;
    } else {
        show(&text::text(&inventory));
    }
    Ok(inventory.exit_code())
}

fn sensors(machine: &Machine, vehicle: &VehicleConfig, probe: bool) -> Vec<Sensor> {
    let connections = live::connections(vehicle).into_iter().zip(&vehicle.sensor_configs);
    let sensors = connections.map(|((id, connect), config)| {
        let state = connect.map_err(|error| OpenError::unusable(&error)).and_then(|connect| {
            let kind = probing::kind(&config.plugin).filter(|_| probe);
            match presence(machine, &connect)? {
                Presence::There(name) => Ok(State::Present(name)),
                // The device sends to a port of this machine, so it can't be probed.
                Presence::Elsewhere if matches!(connect, Connect::UdpListen { .. }) => Ok(State::NotProbed),
                Presence::Elsewhere => match kind {
                    Some(probe) => headrace_ports::probe(&connect, &mut [probe]).map(State::Answered),
                    None => Ok(State::NotProbed),
                },
            }
        });
        Sensor { id: id.to_owned(), connect: config.connect.clone(), state }
    });
    sensors.collect()
}
