//! Text of `headrace devices`: a block for each device, with its problems and their fixes.

use headrace_config::plain::one_line;
use headrace_ports::{Answer, Found, OpenError};
use headrace_sensor::driver::Carrier;

use super::state::{Inventory, Probed, Sensor, State};
use crate::output::append;

/// Width of the key column, characters.
const KEY: usize = 10;

const CARRIERS: [(Carrier, &str); 4] = [
    (Carrier::Serial, "Serial ports"),
    (Carrier::Hid, "HID devices"),
    (Carrier::Can, "CAN interfaces"),
    (Carrier::I2c, "I2C buses"),
];

/// The whole text that `headrace devices` prints.
pub(super) fn text(inventory: &Inventory) -> String {
    let mut text = String::new();
    for (carrier, title) in CARRIERS {
        let found: Vec<_> = inventory.found.iter().filter(|(found, _)| found.carrier == carrier).collect();
        if found.is_empty() {
            append(&mut text, format_args!("{title}: none\n"));
            continue;
        }
        append(&mut text, format_args!("{title}\n"));
        for (found, probed) in found {
            device(&mut text, found, probed.as_ref());
        }
    }
    if !inventory.addresses.is_empty() {
        append(&mut text, format_args!("Addresses\n"));
        for (connect, probed) in &inventory.addresses {
            append(&mut text, format_args!("  {connect}\n"));
            answer(&mut text, probed);
        }
    }
    if let Some(sensors) = &inventory.sensors {
        append(&mut text, format_args!("Sensors\n"));
        let width = sensors.iter().map(|sensor| sensor.id.len()).max().unwrap_or(0);
        for sensor in sensors {
            sensor_line(&mut text, sensor, width);
        }
    }
    text
}

fn device(text: &mut String, found: &Found, probed: Option<&Probed>) {
    let says = found.says.as_ref().map(|says| format!("  {says}")).unwrap_or_default();
    append(text, format_args!("  {}\n", one_line(&format!("{}{says}", found.name))));
    if let Some(connect) = &found.connect {
        append(text, format_args!("    connect = \"{}\"\n", one_line(connect)));
    }
    for (what, value) in &found.details {
        row(text, what, value);
    }
    if let Some(rights) = &found.rights {
        let may = if rights.may_open { "this user may open it" } else { "this user may not open it" };
        row(text, "rights", &format!("{}:{} {:03o}, {may}", rights.owner, rights.group, rights.mode));
    }
    for wrong in &found.troubles {
        trouble(text, wrong);
    }
    if let Some(probed) = probed {
        answer(text, probed);
    }
}

fn row(text: &mut String, what: &str, value: &str) {
    append(text, format_args!("    {what:<KEY$}  {}\n", one_line(value)));
}

fn trouble(text: &mut String, trouble: &OpenError) {
    row(text, "PROBLEM", &trouble.why);
    if let Some(remedy) = &trouble.remedy {
        row(text, "fix", remedy);
    }
}

fn answer(text: &mut String, probed: &Probed) {
    match probed {
        Ok(answer) => row(text, "answers", &answer_text(answer)),
        Err(wrong) => trouble(text, wrong),
    }
}

fn answer_text(answer: &Answer) -> String {
    match answer {
        Answer::Is(identity) => identity.clone(),
        Answer::Unknown(bytes) => format!("{bytes} bytes of an unknown protocol"),
        Answer::Silence => "no answer; is it powered?".to_owned(),
    }
}

fn sensor_line(text: &mut String, sensor: &Sensor, width: usize) {
    let Sensor { id, connect, state } = sensor;
    let state = match state {
        Ok(State::Present(name)) => format!("present, {name}"),
        Ok(State::Answered(answer)) => answer_text(answer),
        Ok(State::NotProbed) => "network address, not probed (--probe)".to_owned(),
        Err(wrong) => {
            append(text, format_args!("  {id:<width$}  {connect}\n"));
            return trouble(text, wrong);
        }
    };
    append(text, format_args!("  {id:<width$}  {connect}: {state}\n"));
}

#[cfg(test)]
mod tests;
