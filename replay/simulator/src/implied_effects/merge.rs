//! Merges many calls for effects into one set of tables. A call is one reason to simulate an effect, see [`Call`].
//! Where two calls for an effect overlap, the keys of the later call apply.

use super::call::{Call, Called, Fate, Value};
use crate::effects::KINDS;

/// The only key of an effect whose value is a list. The lists of several calls for the effect are concatenated. For
/// every other key, the value of the later call applies.
const PLACES: &str = "places";

/// Name of the effect that has one table per group of sensors.
const GROUPED: &str = "interference";

type Keys = Vec<(&'static str, Value)>;

/// Sensors that share tables; the ranges of chainage and the keys of these tables; and, for the effect [`GROUPED`]
/// only, the sensors that the call names.
type Shared<'a> = (Vec<&'a String>, Vec<Piece>, Option<Option<&'a Vec<String>>>);

/// A table to write: the range of chainage where it applies, and its keys.
#[derive(Debug, Clone, PartialEq)]
struct Piece {
    place_m: [f64; 2],
    keys: Keys,
}

/// Merges the calls for each implied effect into its tables.
pub(super) fn merge(calls: &[Call]) -> Vec<Called> {
    let mut all = Vec::new();
    for kind in KINDS {
        let calls: Vec<&Call> = calls.iter().filter(|call| call.effect == kind.name()).collect();
        if calls.is_empty() {
            continue;
        }
        let mut by: Vec<String> = Vec::new();
        for call in &calls {
            if !by.contains(&call.by) {
                by.push(call.by.clone());
            }
        }
        all.push(Called {
            effect: kind.name(),
            by,
            tables: tables(kind.name(), &calls),
            fate: Fate::NotTaken,
        });
    }
    all
}

/// The tables of an effect. Sensors share tables if their ranges of chainage and their keys are the same.
fn tables(effect: &str, calls: &[&Call]) -> String {
    let mut sensors: Vec<Option<&String>> = Vec::new();
    for call in calls {
        let named = call.sensors.as_ref().map_or_else(|| vec![None], |ids| ids.iter().map(Some).collect());
        for sensor in named {
            if !sensors.contains(&sensor) {
                sensors.push(sensor);
            }
        }
    }
    let mut shared: Vec<Shared<'_>> = Vec::new();
    for sensor in sensors {
        let acts = |call: &&&Call| match (&call.sensors, sensor) {
            (Some(ids), Some(id)) => ids.contains(id),
            (None, None) => true,
            _ => false,
        };
        let acting: Vec<&Call> = calls.iter().filter(acts).copied().collect();
        let pieces = pieces(&acting);
        // A table of `interference` lists the heads of one frequency. Two calls therefore give two tables.
        let group = acting.first().filter(|_| effect == GROUPED).map(|call| call.sensors.as_ref());
        match shared.iter_mut().find(|(_, other, of)| *other == pieces && *of == group) {
            Some((ids, ..)) => ids.extend(sensor),
            None => shared.push((sensor.into_iter().collect(), pieces, group)),
        }
    }
    let mut text = String::new();
    for (ids, pieces, _) in &shared {
        for piece in pieces {
            piece.write(effect, ids, &mut text);
        }
    }
    text
}

/// Divides the tunnel into ranges of chainage in which the same calls apply, in order. Ranges without calls are left
/// out.
fn pieces(calls: &[&Call]) -> Vec<Piece> {
    const ALL: [f64; 2] = [f64::NEG_INFINITY, f64::INFINITY];
    let place = |call: &Call| call.place_m.unwrap_or(ALL);
    let mut borders: Vec<f64> = calls.iter().flat_map(|call| place(call)).collect();
    borders.sort_by(f64::total_cmp);
    borders.dedup();
    let mut pieces: Vec<Piece> = Vec::new();
    for (from_m, to_m) in borders.iter().zip(borders.iter().skip(1)) {
        let here = calls.iter().filter(|call| {
            let [first_m, last_m] = place(call);
            first_m <= *from_m && last_m >= *to_m
        });
        let mut keys: Option<Keys> = None;
        for call in here {
            let keys = keys.get_or_insert_with(Vec::new);
            call.keys.iter().for_each(|(key, value)| put(keys, key, value));
        }
        let Some(keys) = keys else { continue };
        match pieces.last_mut() {
            Some(last) if last.keys == keys && last.place_m[1].total_cmp(from_m).is_eq() => {
                last.place_m[1] = *to_m;
            }
            _ => pieces.push(Piece { place_m: [*from_m, *to_m], keys }),
        }
    }
    pieces
}

fn put(keys: &mut Keys, key: &'static str, value: &str) {
    match keys.iter_mut().find(|(other, _)| *other == key) {
        Some((_, held)) if key == PLACES => {
            let (held_inner, added) = (held.trim_end_matches(']').trim_end(), value.trim_start_matches('['));
            *held = format!("{held_inner}, {}", added.trim_start());
        }
        Some((_, held)) => value.clone_into(held),
        None => keys.push((key, value.to_owned())),
    }
}

impl Piece {
    fn write(&self, effect: &str, sensors: &[&String], text: &mut String) {
        let [from_m, to_m] = self.place_m;
        let mut lines = Vec::new();
        if !sensors.is_empty() {
            lines.push(format!("sensors = {sensors:?}"));
        }
        if from_m.is_finite() {
            lines.push(format!("from_m = {from_m:?}"));
        }
        if to_m.is_finite() {
            lines.push(format!("to_m = {to_m:?}"));
        }
        lines.extend(self.keys.iter().map(|(key, value)| format!("{key} = {value}")));
        lines.push(String::new());
        lines.insert(0, format!("[[effects.{effect}]]"));
        text.push_str(&lines.join("\n"));
    }
}
