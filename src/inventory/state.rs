//! Results of `headrace devices`, and their JSON.

use headrace_ports::{Answer, Found, OpenError};
use headrace_sensor::connect::Connect;
use serde_json::{Value, json};

use crate::failure;

/// Result of probing a port or an address.
pub(super) type Probed = Result<Answer, OpenError>;

/// All results of `headrace devices`.
#[derive(Debug, Default)]
pub(super) struct Inventory {
    /// Attached devices, each with the probe's result if it was probed.
    pub(super) found: Vec<(Found, Option<Probed>)>,
    /// Addresses given with `--address`, each with the probe's result.
    pub(super) addresses: Vec<(Connect, Probed)>,
    /// Sensors of the vehicle file, each with the state of its port; `None` without a vehicle file.
    pub(super) sensors: Option<Vec<Sensor>>,
}

/// A sensor of the vehicle file, and the state of its port.
#[derive(Debug)]
pub(super) struct Sensor {
    pub(super) id: String,
    pub(super) connect: String,
    pub(super) state: Result<State, OpenError>,
}

/// State of a sensor's port if no error was found.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum State {
    /// The port is present under this name and may be opened.
    Present(String),
    /// The device was probed and has answered.
    Answered(Answer),
    /// The port is a network address that was not probed.
    NotProbed,
}

impl Inventory {
    /// Returns 1 if a sensor's port is missing, may not be opened, or didn't answer a probe.
    pub(super) fn exit_code(&self) -> u8 {
        let mut sensors = self.sensors.iter().flatten();
        if sensors.any(|sensor| !sensor.is_ready()) { failure::FAILED } else { failure::OK }
    }

    pub(super) fn json(&self) -> Value {
        let found: Vec<Value> = self.found.iter().map(found_json).collect();
        let addresses = self
            .addresses
            .iter()
            .map(|(connect, probed)| json!({"connect": connect.to_string(), "answer": probed_json(probed)}));
        let sensors = self.sensors.iter().flatten().map(Sensor::json);
        json!({
            "found": found,
            "addresses": addresses.collect::<Vec<Value>>(),
            "sensors": self.sensors.is_some().then(|| sensors.collect::<Vec<Value>>()),
        })
    }
}

impl Sensor {
    fn is_ready(&self) -> bool {
        self.state.as_ref().is_ok_and(|state| *state != State::Answered(Answer::Silence))
    }

    fn json(&self) -> Value {
        let mut shown = json!({"id": self.id, "connect": self.connect, "ok": self.is_ready()});
        let more = match &self.state {
            Ok(State::Present(name)) => ("name", json!(name)),
            Ok(State::Answered(answer)) => ("answer", answer_json(answer)),
            Ok(State::NotProbed) => ("answer", Value::Null),
            Err(trouble) => ("trouble", trouble_json(trouble)),
        };
        if let Some(shown) = shown.as_object_mut() {
            shown.insert(more.0.to_owned(), more.1);
        }
        shown
    }
}

fn found_json((found, probed): &(Found, Option<Probed>)) -> Value {
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
        "answer": probed.as_ref().map(probed_json),
    })
}

fn probed_json(probed: &Probed) -> Value {
    match probed {
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

fn trouble_json(trouble: &OpenError) -> Value {
    json!({"why": trouble.why, "remedy": trouble.remedy})
}
