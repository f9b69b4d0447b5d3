//! `headrace devices`: what is plugged in, what keeps us from it, and what answers there.

mod asking;
mod words;

use headrace_ports::{Answer, Found, Machine, Presence, Trouble, discover, presence};
use headrace_sensor::connect::Connect;
use headrace_vehicle::VehicleConfig;
use serde_json::{Value, json};

use crate::cli::Devices;
use crate::commands::vehicle_file;
use crate::failure::{self, Failure};
use crate::live;
use crate::output::{deliver, put};

/// What came of asking on a line.
type Asked = Result<Answer, Trouble>;

/// All that the command has to say.
#[derive(Debug, Default)]
struct Inventory {
    /// What is plugged in, and what it answered where it was asked.
    found: Vec<(Found, Option<Asked>)>,
    /// Addresses that were named, and what they answered.
    addresses: Vec<(Connect, Asked)>,
    /// The sensors of a vehicle file.
    sensors: Option<Vec<Sensor>>,
}

/// A sensor of a vehicle file.
#[derive(Debug)]
struct Sensor {
    id: String,
    connect: String,
    state: Result<State, Trouble>,
}

/// What is known of a sensor's port that nothing is wrong with.
#[derive(Debug, PartialEq, Eq)]
enum State {
    /// It is there and may be opened, under this name.
    There(String),
    /// It has been asked.
    Answered(Answer),
    /// Only asking can tell.
    NotAsked,
}

/// Shows what is plugged in.
pub(crate) fn devices(args: &Devices) -> Result<u8, Failure> {
    let machine = Machine::ours();
    let vehicle = args.vehicle.as_ref().map(|path| vehicle_file(path)).transpose()?;
    let found = discover(&machine);
    let found = found.into_iter().map(|found| {
        let asked = args.probe.then(|| asking::port(&found)).flatten();
        (found, asked)
    });
    let found = found.collect();
    let addresses = args.address.iter().map(|connect| (connect.clone(), asking::address(connect)));
    let addresses = addresses.collect();
    let sensors = vehicle.map(|(_, vehicle)| sensors(&machine, &vehicle, args.probe));
    let inventory = Inventory { found, addresses, sensors };
    if args.json {
        deliver(&inventory.json().to_string())?;
    } else {
        put(&words::text(&inventory));
    }
    Ok(inventory.exit_code())
}

fn sensors(machine: &Machine, vehicle: &VehicleConfig, probe: bool) -> Vec<Sensor> {
    let connections = live::connections(vehicle).into_iter().zip(&vehicle.sensor_configs);
    let sensors = connections.map(|((id, connect), config)| {
        let state = connect.map_err(|error| Trouble::unusable(&error)).and_then(|connect| {
            let kind = asking::kind(&config.plugin).filter(|_| probe);
            match presence(machine, &connect)? {
                Presence::There(name) => Ok(State::There(name)),
                // A port of ours is where others send to.
                Presence::Elsewhere if matches!(connect, Connect::UdpListen { .. }) => Ok(State::NotAsked),
                Presence::Elsewhere => match kind {
                    Some(probe) => headrace_ports::probe(&connect, &mut [probe]).map(State::Answered),
                    None => Ok(State::NotAsked),
                },
            }
        });
        Sensor { id: id.to_owned(), connect: config.connect.clone(), state }
    });
    sensors.collect()
}

impl Inventory {
    /// 1 when a sensor's port isn't there, may not be opened, or says nothing.
    fn exit_code(&self) -> u8 {
        let mut sensors = self.sensors.iter().flatten();
        if sensors.any(|sensor| !sensor.is_well()) { failure::FAILED } else { failure::OK }
    }

    fn json(&self) -> Value {
        let found: Vec<Value> = self.found.iter().map(found_json).collect();
        let addresses = self
            .addresses
            .iter()
            .map(|(connect, asked)| json!({"connect": connect.to_string(), "answer": asked_json(asked)}));
        let sensors = self.sensors.iter().flatten().map(Sensor::json);
        json!({
            "found": found,
            "addresses": addresses.collect::<Vec<Value>>(),
            "sensors": self.sensors.is_some().then(|| sensors.collect::<Vec<Value>>()),
        })
    }
}

impl Sensor {
    fn is_well(&self) -> bool {
        self.state.as_ref().is_ok_and(|state| *state != State::Answered(Answer::Silence))
    }

    fn json(&self) -> Value {
        let mut shown = json!({"id": self.id, "connect": self.connect, "ok": self.is_well()});
        let more = match &self.state {
            Ok(State::There(name)) => ("name", json!(name)),
            Ok(State::Answered(answer)) => ("answer", answer_json(answer)),
            Ok(State::NotAsked) => ("answer", Value::Null),
            Err(trouble) => ("trouble", trouble_json(trouble)),
        };
        if let Some(shown) = shown.as_object_mut() {
            shown.insert(more.0.to_owned(), more.1);
        }
        shown
    }
}

fn found_json((found, asked): &(Found, Option<Asked>)) -> Value {
    let details: serde_json::Map<String, Value> =
        found.details.iter().map(|(what, value)| ((*what).to_owned(), json!(value))).collect();
    let rights = found.rights.as_ref().map(|rights| {
        let mode = format!("{:03o}", rights.mode);
        json!({"owner": rights.owner, "group": rights.group, "mode": mode, "may_open": rights.may_open})
    });
    json!({
        "carrier": found.carrier.as_str().trim_end_matches(':'),
        "name": found.name,
        "says": found.says,
        "connect": found.connect,
        "details": details,
        "rights": rights,
        "troubles": found.troubles.iter().map(trouble_json).collect::<Vec<Value>>(),
        "answer": asked.as_ref().map(asked_json),
    })
}

fn asked_json(asked: &Asked) -> Value {
    match asked {
        Ok(answer) => answer_json(answer),
        Err(trouble) => json!({"trouble": trouble_json(trouble)}),
    }
}

fn answer_json(answer: &Answer) -> Value {
    match answer {
        Answer::Is(identity) => json!({"is": identity}),
        Answer::Unknown(bytes) => json!({"unknown_bytes": bytes}),
        Answer::Silence => json!({"unknown_bytes": 0}),
    }
}

fn trouble_json(trouble: &Trouble) -> Value {
    json!({"why": trouble.why, "remedy": trouble.remedy})
}
