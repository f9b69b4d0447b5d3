//! Checks values against the part of JSON Schema (2020-12) that this repository's schemas use. Unknown keywords are
//! errors.
//!
//! No crate for JSON Schema is used, because it increases the number of packages in the workspace's build by a third.

use serde_json::{Map, Value};

/// The ways in which `value` violates the schema, as text; empty if it is valid.
pub fn faults(schema: &Value, value: &Value) -> Vec<String> {
    let mut faults = Vec::new();
    Checker { root: schema, faults: &mut faults }.check("", schema, value);
    faults
}

struct Checker<'a> {
    root: &'a Value,
    faults: &'a mut Vec<String>,
}

impl Checker<'_> {
    fn check(&mut self, place: &str, schema: &Value, value: &Value) {
        for (keyword, wanted) in schema.as_object().unwrap() {
            let right = match keyword.as_str() {
                "$schema" | "$defs" | "title" | "description" | "additionalProperties" => true,
                "$ref" => {
                    let target = wanted.as_str().unwrap().strip_prefix('#').unwrap();
                    self.check(place, self.root.pointer(target).unwrap(), value);
                    true
                }
                "anyOf" => wanted.as_array().unwrap().iter().any(|one| {
                    let mut faults = Vec::new();
                    Checker { root: self.root, faults: &mut faults }.check(place, one, value);
                    faults.is_empty()
                }),
                "type" => match wanted {
                    Value::Array(types) => types.iter().any(|one| is_a(one.as_str().unwrap(), value)),
                    one => is_a(one.as_str().unwrap(), value),
                },
                "oneOf" => {
                    let fits = |one: &&Value| faults(one, value).is_empty();
                    wanted.as_array().unwrap().iter().filter(fits).count() == 1
                }
                // For `contentEncoding`, only the encoding is checked, and not the decoded content.
                "contentEncoding" => wanted == "base64" && base64(value.as_str().unwrap()).is_some(),
                "const" => value == wanted,
                "enum" => wanted.as_array().unwrap().contains(value),
                "minimum" => value.as_f64().is_none_or(|number| number >= wanted.as_f64().unwrap()),
                "maximum" => value.as_f64().is_none_or(|number| number <= wanted.as_f64().unwrap()),
                "required" => {
                    let there = |key: &Value| value.get(key.as_str().unwrap()).is_some();
                    !value.is_object() || wanted.as_array().unwrap().iter().all(there)
                }
                "properties" => {
                    self.properties(place, schema, wanted.as_object().unwrap(), value);
                    true
                }
                "items" => {
                    for (index, item) in value.as_array().into_iter().flatten().enumerate() {
                        self.check(&format!("{place}/{index}"), wanted, item);
                    }
                    true
                }
                unknown => panic!("{place}: the checker doesn't know {unknown:?}"),
            };
            if !right {
                self.faults.push(format!("{place}: {value} is not as {keyword} {wanted} says"));
            }
        }
    }

    fn properties(&mut self, place: &str, schema: &Value, properties: &Map<String, Value>, value: &Value) {
        for (key, value) in value.as_object().into_iter().flatten() {
            let place = format!("{place}/{key}");
            match properties.get(key) {
                Some(schema) => self.check(&place, schema, value),
                None if schema["additionalProperties"] == false => {
                    self.faults.push(format!("{place}: unknown"));
                }
                None => {}
            }
        }
    }
}

fn is_a(kind: &str, value: &Value) -> bool {
    match kind {
        "null" => value.is_null(),
        "boolean" => value.is_boolean(),
        "integer" => value.is_u64() || value.is_i64(),
        "number" => value.is_number(),
        "string" => value.is_string(),
        "array" => value.is_array(),
        "object" => value.is_object(),
        other => panic!("the checker doesn't know the type {other:?}"),
    }
}

/// Decodes base64 (RFC 4648, with padding); `None` if the text is invalid.
pub fn base64(text: &str) -> Option<Vec<u8>> {
    const DIGITS: &str = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let (groups, rest) = text.as_bytes().as_chunks::<4>();
    let mut bytes = Vec::new();
    for group in groups {
        let padding = group.iter().rev().take_while(|byte| **byte == b'=').count();
        let mut bits = 0_u32;
        for byte in &group[..4 - padding.min(2)] {
            bits = bits << 6 | u32::try_from(DIGITS.find(char::from(*byte))?).ok()?;
        }
        bits <<= 6 * padding.min(2);
        bytes.extend_from_slice(&bits.to_be_bytes()[1..4 - padding.min(2)]);
    }
    rest.is_empty().then_some(bytes)
}
