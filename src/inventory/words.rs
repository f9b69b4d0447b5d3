//! What `headrace devices` says to people: a block for each device, with what is wrong and what mends it under it.

use headrace_ports::{Answer, Found, Trouble};
use headrace_sensor::driver::Carrier;

use super::{Asked, Inventory, Sensor, State};
use crate::output::append;

/// Where values begin, below a device's name.
const KEY: usize = 10;

const CARRIERS: [(Carrier, &str); 4] = [
    (Carrier::Serial, "Serial ports"),
    (Carrier::Hid, "HID devices"),
    (Carrier::Can, "CAN interfaces"),
    (Carrier::I2c, "I2C buses"),
];

/// All of it.
pub(super) fn text(inventory: &Inventory) -> String {
    let mut text = String::new();
    for (carrier, title) in CARRIERS {
        let found: Vec<_> = inventory.found.iter().filter(|(found, _)| found.carrier == carrier).collect();
        if found.is_empty() {
            append(&mut text, format_args!("{title}: none\n"));
            continue;
        }
        append(&mut text, format_args!("{title}\n"));
        for (found, asked) in found {
            device(&mut text, found, asked.as_ref());
        }
    }
    if !inventory.addresses.is_empty() {
        append(&mut text, format_args!("Addresses\n"));
        for (connect, asked) in &inventory.addresses {
            append(&mut text, format_args!("  {connect}\n"));
            answer(&mut text, asked);
        }
    }
    if let Some(sensors) = &inventory.sensors {
        append(&mut text, format_args!("Sensors\n"));
        let width = sensors.iter().map(|sensor| sensor.id.len()).max().unwrap_or(0);
        for sensor in sensors {
            say_sensor(&mut text, sensor, width);
        }
    }
    text
}

fn device(text: &mut String, found: &Found, asked: Option<&Asked>) {
    let says = found.says.as_ref().map(|says| format!("  {says}")).unwrap_or_default();
    append(text, format_args!("  {}{says}\n", found.name));
    if let Some(connect) = &found.connect {
        append(text, format_args!("    connect = \"{connect}\"\n"));
    }
    for (what, value) in &found.details {
        row(text, what, value);
    }
    if let Some(rights) = &found.rights {
        let may = if rights.may_open { "this user may open it" } else { "not for this user" };
        row(text, "rights", &format!("{}:{} {:03o}, {may}", rights.owner, rights.group, rights.mode));
    }
    for wrong in &found.troubles {
        trouble(text, wrong);
    }
    if let Some(asked) = asked {
        answer(text, asked);
    }
}

fn row(text: &mut String, what: &str, value: &str) {
    append(text, format_args!("    {what:<KEY$}  {value}\n"));
}

fn trouble(text: &mut String, trouble: &Trouble) {
    row(text, "PROBLEM", &trouble.why);
    if let Some(remedy) = &trouble.remedy {
        row(text, "mend by", remedy);
    }
}

fn answer(text: &mut String, asked: &Asked) {
    match asked {
        Ok(answer) => row(text, "answers", &answer_words(answer)),
        Err(wrong) => trouble(text, wrong),
    }
}

fn answer_words(answer: &Answer) -> String {
    match answer {
        Answer::Is(identity) => identity.clone(),
        Answer::Unknown(bytes) => format!("{bytes} bytes that no kind of ours understands"),
        Answer::Silence => "nothing; is it switched on?".to_owned(),
    }
}

fn say_sensor(text: &mut String, sensor: &Sensor, width: usize) {
    let Sensor { id, connect, state } = sensor;
    let state = match state {
        Ok(State::There(name)) => format!("there, {name}"),
        Ok(State::Answered(answer)) => answer_words(answer),
        Ok(State::NotAsked) => "an address; only run and --probe can tell".to_owned(),
        Err(wrong) => {
            append(text, format_args!("  {id:<width$}  {connect}\n"));
            return trouble(text, wrong);
        }
    };
    append(text, format_args!("  {id:<width$}  {connect}: {state}\n"));
}

#[cfg(test)]
mod tests;
