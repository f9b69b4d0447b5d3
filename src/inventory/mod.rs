//! `headrace devices`: lists attached devices and permissions, and with `--probe` their answers.

mod state;
mod text;

use headrace_devices::KINDS;
use headrace_ports::{Found, Machine, OpenError, Presence, discover, presence};
use headrace_sensor::connect::Connect;
use headrace_sensor::driver::{Carrier, Probe};
use headrace_vehicle::VehicleConfig;

use crate::cli::Devices;
use crate::failure::Failure;
use crate::live;
use crate::output::{deliver, show};
use crate::vehicle_file;
use state::{Inventory, Probed, Sensor, State};

/// Lists the attached devices.
///
/// The exit code is 1 if a sensor's port is missing, may not be opened, or doesn't answer.
pub(crate) fn devices(args: &Devices) -> Result<u8, Failure> {
    let machine = Machine::ours();
    let vehicle = args.vehicle.as_ref().map(|path| vehicle_file::read(path)).transpose()?;
    let found = discover(&machine);
    let found = found.into_iter().map(|found| {
        let probed = args.probe.then(|| probe_port(&found)).flatten();
        (found, probed)
    });
    let found = found.collect();
    let addresses = args.address.iter().map(|connect| (connect.clone(), probe_address(connect)));
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
            let mut probes = if probe { probes_of(&config.plugin) } else { Vec::new() };
            match presence(machine, &connect)? {
                Presence::There(name) => Ok(State::Present(name)),
                // The device sends to a port of this machine, so it can't be probed.
                Presence::Elsewhere if matches!(connect, Connect::UdpListen { .. }) => Ok(State::NotProbed),
                Presence::Elsewhere if probes.is_empty() => Ok(State::NotProbed),
                Presence::Elsewhere => headrace_ports::probe(&connect, &mut probes).map(State::Answered),
            }
        });
        Sensor { id: id.to_owned(), connect: config.connect.clone(), state }
    });
    sensors.collect()
}

/// The probes of all device kinds, in the order in which a port is probed.
fn all_probes() -> Vec<Box<dyn Probe>> {
    KINDS.iter().flat_map(|kind| kind.probes()).collect()
}

/// Probes of the device kind with this name in vehicle files.
fn probes_of(name: &str) -> Vec<Box<dyn Probe>> {
    KINDS.iter().filter(|kind| kind.name() == name).flat_map(|kind| kind.probes()).collect()
}

/// Probes a serial port that may be opened; `None` for other ports.
fn probe_port(found: &Found) -> Option<Probed> {
    if found.carrier != Carrier::Serial || !found.troubles.is_empty() {
        return None;
    }
    let connect = Connect::parse(found.connect.as_ref()?).ok()?;
    Some(probe_address(&connect))
}

/// Probes the device at a network address.
fn probe_address(connect: &Connect) -> Probed {
    headrace_ports::probe(connect, &mut all_probes())
}
