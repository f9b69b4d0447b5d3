//! Lines that an A50 sends. Each line is a JSON object and a newline. Velocity reports are decoded; other
//! objects are accepted but unused.
//!
//! Source: Water Linked, "DVL A50/A125 TCP JSON API", json_v3 to json_v3.3.

use headrace_sensor::codec::{Framed, Framing, Verdict};
use headrace_sensor::geometry::math;
use hifijson::num::LexWrite as _;
use hifijson::str::{Lex as _, LexWrite as _};
use hifijson::token::Lex as _;
use hifijson::{Error, Expect, SliceLexer};
use serde::{Deserialize, Serialize};

/// Maximum line length. A velocity report has about 1,100 bytes.
pub const MAX_LINE_BYTES: usize = 4096;

/// Maximum nesting of arrays and objects in a line; a report needs three levels.
const MAX_DEPTH: usize = 8;

/// Medium relative to which a velocity is measured.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Against {
    /// The ground, or a wall.
    Bottom,
    /// Layers of water below the vehicle.
    Water,
}

/// A velocity report, in the device's units and axes: x forward, y right, z down (the direction in which the device
/// looks).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Velocity {
    /// Reference of the velocity.
    pub against: Against,
    /// Velocity of the vehicle in device axes, m/s.
    pub velocity_mps: [f64; 3],
    /// Figure of merit: error estimate of the velocity, m/s.
    pub fom_mps: f64,
    /// Distance to the reflecting surface along z, m.
    pub altitude_m: f64,
    /// Number of beams with a valid measurement.
    pub valid_beams: u8,
    /// Whether the device marks velocity and altitude as valid.
    pub is_valid: bool,
    /// Status bits. The bit with value 1 means too hot; the other bits are undefined.
    pub status: u8,
    /// Device timestamps of the reflection and of sending the report, microseconds.
    pub times_us: Option<[i64; 2]>,
}

impl Velocity {
    /// Encodes the decoded fields as a line.
    pub fn encode(&self) -> Vec<u8> {
        let kind = match self.against {
            Against::Bottom => "velocity",
            Against::Water => "velocity_water",
        };
        let [x, y, z] = self.velocity_mps;
        let beams = (0..self.valid_beams.max(4)).map(|id| {
            let (distance_m, valid) = (self.altitude_m, id < self.valid_beams);
            format!("{{\"id\":{id},\"velocity\":0.0,\"distance\":{distance_m:?},\"beam_valid\":{valid}}}")
        });
        let beams: Vec<_> = beams.collect();
        let times = self.times_us.map_or_else(String::new, |[validity, transmission]| {
            format!(",\"time_of_validity\":{validity},\"time_of_transmission\":{transmission}")
        });
        let line = format!(
            "{{\"vx\":{x:?},\"vy\":{y:?},\"vz\":{z:?},\"fom\":{:?},\"altitude\":{:?},\"transducers\":[{}],\
             \"velocity_valid\":{},\"status\":{},\"format\":\"json_v3.1\",\"type\":\"{kind}\"{times}}}\r\n",
            self.fom_mps,
            self.altitude_m,
            beams.join(","),
            self.is_valid,
            self.status,
        );
        line.into_bytes()
    }
}

/// Kind of a line that holds a JSON object.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Line {
    Velocity(Velocity),
    Other,
}

/// Fields of a velocity report found so far.
#[derive(Debug, Clone, Copy, Default)]
struct Found {
    against: Option<Against>,
    velocity_mps: [Option<f64>; 3],
    fom_mps: Option<f64>,
    altitude_m: Option<f64>,
    valid_beams: Option<u8>,
    is_valid: Option<bool>,
    status: Option<u8>,
    times_us: [Option<i64>; 2],
}

impl Found {
    /// Reads the value of a key; `next` is the value's first byte. A value of an unexpected type makes the report
    /// invalid.
    fn take(&mut self, key: &[u8], next: u8, lexer: &mut SliceLexer<'_>) -> Result<(), Error> {
        let [x, y, z] = &mut self.velocity_mps;
        let [validity, transmission] = &mut self.times_us;
        match key {
            b"vx" => *x = Some(number(lexer)?),
            b"vy" => *y = Some(number(lexer)?),
            b"vz" => *z = Some(number(lexer)?),
            b"fom" => self.fom_mps = Some(number(lexer)?),
            b"altitude" => self.altitude_m = Some(number(lexer)?),
            b"transducers" => self.valid_beams = Some(valid_beams(next, lexer)?),
            b"velocity_valid" => self.is_valid = Some(boolean(next, lexer)?),
            b"status" => {
                let status = math::round_to_i64(number(lexer)?);
                self.status = Some(u8::try_from(status).map_err(|_| Expect::Value)?);
            }
            b"time_of_validity" => *validity = Some(math::round_to_i64(number(lexer)?)),
            b"time_of_transmission" => *transmission = Some(math::round_to_i64(number(lexer)?)),
            b"type" => {
                self.against = Some(match text(next, lexer)? {
                    b"velocity_water" => Against::Water,
                    _ => Against::Bottom,
                });
            }
            _ => skip(next, lexer, MAX_DEPTH - 1)?,
        }
        Ok(())
    }

    /// Returns the report; `None` if a field is missing.
    fn whole(self) -> Option<Velocity> {
        let [x, y, z] = self.velocity_mps;
        let [validity, transmission] = self.times_us;
        Some(Velocity {
            against: self.against?,
            velocity_mps: [x?, y?, z?],
            fom_mps: self.fom_mps?,
            altitude_m: self.altitude_m?,
            valid_beams: self.valid_beams?,
            is_valid: self.is_valid?,
            status: self.status.unwrap_or(0),
            times_us: validity.zip(transmission).map(|(validity, transmission)| [validity, transmission]),
        })
    }
}

fn valid_beams(next: u8, lexer: &mut SliceLexer<'_>) -> Result<u8, Error> {
    let mut valid = 0_u8;
    lexer.expect(|_| Some(next), b'[').ok_or(Expect::Value)?;
    lexer.seq(b']', SliceLexer::ws_peek, |next, lexer| {
        object(next, lexer, |key, next, lexer| match key {
            b"beam_valid" => {
                valid = valid.checked_add(u8::from(boolean(next, lexer)?)).ok_or(Expect::Value)?;
                Ok(())
            }
            _ => skip(next, lexer, MAX_DEPTH - 3),
        })
    })?;
    Ok(valid)
}

/// Whether the object's `type` is the type of a velocity report.
fn is_velocity(line: &str) -> Result<bool, Error> {
    let mut is_velocity = false;
    SliceLexer::new(line.as_bytes()).exactly_one(SliceLexer::ws_peek, |next, lexer| {
        object(next, lexer, |key, next, lexer| {
            if key == b"type" {
                is_velocity = matches!(text(next, lexer)?, b"velocity" | b"velocity_water");
                return Ok(());
            }
            skip(next, lexer, MAX_DEPTH - 1)
        })
    })?;
    Ok(is_velocity)
}

/// Parses a line; `None` if the line is no JSON object, or is a velocity report with a missing field.
fn line(line: &[u8]) -> Option<Line> {
    let line = core::str::from_utf8(line).ok()?;
    if !is_velocity(line).ok()? {
        return Some(Line::Other);
    }
    let mut found = Found::default();
    SliceLexer::new(line.as_bytes())
        .exactly_one(SliceLexer::ws_peek, |next, lexer| {
            object(next, lexer, |key, next, lexer| found.take(key, next, lexer))
        })
        .ok()?;
    found.whole().map(Line::Velocity)
}

/// Calls `field` for each key of a JSON object, with the first byte of the key's value. `field` must consume
/// the value.
///
/// Escapes in the key are not decoded.
fn object<'a>(
    next: u8,
    lexer: &mut SliceLexer<'a>,
    mut field: impl FnMut(&'a [u8], u8, &mut SliceLexer<'a>) -> Result<(), Error>,
) -> Result<(), Error> {
    lexer.expect(|_| Some(next), b'{').ok_or(Expect::Value)?;
    lexer.seq(b'}', SliceLexer::ws_peek, |next, lexer| {
        let key = text(next, lexer)?;
        lexer.expect(SliceLexer::ws_peek, b':').ok_or(Expect::Colon)?;
        let next = lexer.ws_peek().ok_or(Expect::Value)?;
        field(key, next, lexer)
    })
}

/// Parses a JSON string; returns it without quotes. Escapes are not decoded.
fn text<'a>(next: u8, lexer: &mut SliceLexer<'a>) -> Result<&'a [u8], Error> {
    let mut text = <&[u8]>::default();
    lexer.expect(|_| Some(next), b'"').ok_or(Expect::String)?;
    lexer.str_bytes(&mut text)?;
    Ok(text)
}

/// Parses a JSON number; it must be finite as a double.
fn number(lexer: &mut SliceLexer<'_>) -> Result<f64, Error> {
    let (text, _) = lexer.num_string().validated()?;
    Ok(text.parse().ok().filter(|number: &f64| number.is_finite()).ok_or(Expect::Value)?)
}

fn boolean(next: u8, lexer: &mut SliceLexer<'_>) -> Result<bool, Error> {
    let word = next.is_ascii_lowercase().then(|| lexer.null_or_bool());
    Ok(word.flatten().flatten().ok_or(Expect::Value)?)
}

/// Skips a JSON value that has at most `depth` levels of arrays and objects.
fn skip(next: u8, lexer: &mut SliceLexer<'_>, depth: usize) -> Result<(), Error> {
    match next {
        b'[' | b'{' if depth == 0 => Err(Error::Depth),
        b'[' => lexer.discarded().seq(b']', SliceLexer::ws_peek, |next, lexer| skip(next, lexer, depth - 1)),
        b'{' => object(next, lexer, |_, next, lexer| skip(next, lexer, depth - 1)),
        b'"' => Ok(lexer.discarded().str_ignore()?),
        b'a'..=b'z' => Ok(lexer.null_or_bool().map(|_| ()).ok_or(Expect::Value)?),
        _ => number(lexer).map(|_| ()),
    }
}

/// Maximum length of a displayed format name, bytes.
const MAX_FORMAT_BYTES: usize = 24;

/// Name of the format in a line, or in a part of a line. The decoder may not know this format.
///
/// Only letters, digits, `_` and `.` are accepted, because the name is displayed.
pub(crate) fn format_of(bytes: &[u8]) -> Option<String> {
    const KEY: &[u8] = b"\"format\"";
    let at = bytes.windows(KEY.len()).position(|window| window == KEY)?;
    let value = bytes.get(at + KEY.len()..)?.iter().skip_while(|byte| matches!(byte, b' ' | b':'));
    let name: Vec<u8> =
        value.skip(1).copied().take_while(|byte| *byte != b'"').take(MAX_FORMAT_BYTES).collect();
    let is_plain = |byte: &u8| byte.is_ascii_alphanumeric() || matches!(byte, b'_' | b'.');
    (!name.is_empty() && name.iter().all(is_plain)).then(|| String::from_utf8_lossy(&name).into_owned())
}

/// Separates lines in a byte stream. A velocity report with a missing field is a bad line.
#[derive(Debug, Clone, Copy, Default)]
pub struct Lines;

/// Decodes the connection's bytes into velocity reports.
pub type LineCodec = Framed<Lines, MAX_LINE_BYTES>;

impl Framing for Lines {
    type Value = Velocity;

    fn judge(&self, front: &[u8]) -> Verdict {
        match front {
            [b'{', b'"' | b' ' | b'}', ..] | [b'{'] => (),
            _ => return Verdict::NotAStart,
        }
        match front.iter().position(|byte| *byte == b'\n') {
            Some(end) => Verdict::on(front, end + 1, |text| line(text).is_some()),
            None => Verdict::Need(front.len() + 1),
        }
    }

    fn read(&self, frame: &[u8]) -> Option<Velocity> {
        match line(frame)? {
            Line::Velocity(velocity) => Some(velocity),
            Line::Other => None,
        }
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use headrace_sensor::codec::contract::decode_all;
    use headrace_sensor::codec::{Codec as _, CodecCounts};
    use proptest::prelude::*;
    use serde_json::Value;

    use super::*;

    /// The maker's example report, on one line.
    pub(crate) const EXAMPLE: &str = concat!(
        r#"{"time": 106.3935775756836, "vx": -3.713480691658333e-05, "vy": 5.703703573090024e-05, "#,
        r#""vz": 2.4990416932269e-05, "fom": 0.00016016385052353144, "covariance": "#,
        r#"[[2.4471841442164077e-08, -3.3937477272871774e-09, -1.6659699175747278e-09], "#,
        r#"[-3.3937477272871774e-09, 1.4654466085062268e-08, 4.0409570134514183e-10], "#,
        r#"[-1.6659699175747278e-09, 4.0409570134514183e-10, 1.5971971523143225e-09]], "#,
        r#""altitude": 0.4949815273284912, "transducers": ["#,
        r#"{"id": 0, "velocity": 0.000108, "distance": 0.5568, "rssi": -30.49, "nsd": -88.7, "beam_valid": true}, "#,
        r#"{"id": 1, "velocity": -1.47e-05, "distance": 0.5664, "rssi": -31.1, "nsd": -89.5, "beam_valid": true}, "#,
        r#"{"id": 2, "velocity": 2.79e-05, "distance": 0.5376, "rssi": -27.2, "nsd": -97.0, "beam_valid": true}, "#,
        r#"{"id": 3, "velocity": 1.94e-05, "distance": 0.5472, "rssi": -28.0, "nsd": -88.3, "beam_valid": true}], "#,
        r#""velocity_valid": true, "status": 0, "tracking_mode": "bottom", "format": "json_v3.2", "#,
        r#""type": "velocity", "time_of_validity": 1638191471563017, "time_of_transmission": 1638191471752336}"#,
        "\r\n"
    );
    const POSITION: &str = concat!(
        r#"{"ts": 49056.809, "x": 12.4, "y": 64.6, "z": 1.8, "std": 0.002, "roll": 0.6, "pitch": 0.6, "yaw": 0.6, "#,
        r#""type": "position_local", "status": 0, "format": "json_v3.1"}"#,
        "\n"
    );
    const RESPONSE: &str = concat!(
        r#"{"response_to":"set_config","success":true,"error_message":"","result":null,"#,
        r#""format":"json_v3.1","type":"response"}"#,
        "\n"
    );

    #[test]
    fn maker_example_is_read() {
        let got = decode_all(&mut LineCodec::default(), EXAMPLE.as_bytes());
        let velocity = Velocity {
            against: Against::Bottom,
            velocity_mps: [-3.713_480_691_658_333e-5, 5.703_703_573_090_024e-5, 2.499_041_693_226_9e-5],
            fom_mps: 0.000_160_163_850_523_531_44,
            altitude_m: 0.494_981_527_328_491_2,
            valid_beams: 4,
            is_valid: true,
            status: 0,
            times_us: Some([1_638_191_471_563_017, 1_638_191_471_752_336]),
        };
        assert_eq!(got, [velocity]);
    }

    #[test]
    fn lines_other_than_velocity_reports_are_accepted_but_give_no_reading() {
        let mut codec = LineCodec::default();
        let lines = [POSITION, RESPONSE, "{}\n", EXAMPLE].concat();
        assert_eq!(decode_all(&mut codec, lines.as_bytes()).len(), 1);
        assert_eq!(codec.counts(), CodecCounts { good_frames: 4, ..CodecCounts::default() });
    }

    #[test]
    fn report_with_a_missing_field_is_a_bad_line() {
        for (what, instead) in [
            ("\"vx\": -3.713480691658333e-05, ", ""),
            ("\"vy\": 5.703703573090024e-05", "\"vy\": null"),
            ("\"velocity_valid\": true", "\"velocity_valid\": 1"),
            ("\"status\": 0", "\"status\": 300"),
            ("\"beam_valid\": true", "\"beam_valid\": \"yes\""),
            ("0.00016016385052353144", "NaN"),
        ] {
            assert!(EXAMPLE.contains(what));
            let mut codec = LineCodec::default();
            assert_eq!(decode_all(&mut codec, EXAMPLE.replace(what, instead).as_bytes()), [], "{what}");
            assert!(codec.counts().bad_frames > 0, "{what}");
        }
    }

    #[test]
    fn reports_of_older_firmware_have_no_times() {
        let times = ", \"time_of_validity\": 1638191471563017, \"time_of_transmission\": 1638191471752336";
        let got = decode_all(&mut LineCodec::default(), EXAMPLE.replace(times, "").as_bytes());
        assert_eq!((got.len(), got[0].times_us), (1, None));
    }

    #[test]
    fn endless_line_stays_within_the_buffer() {
        let endless = [b"{\"".to_vec(), vec![b'a'; 3 * MAX_LINE_BYTES]].concat();
        let mut codec = LineCodec::default();
        let got = decode_all(&mut codec, &[&endless, EXAMPLE.as_bytes()].concat());
        assert_eq!((got.len(), codec.counts().skipped_bytes), (1, endless.len() as u64));
    }

    /// Whether the parser accepts a line in which an unknown key has this JSON value.
    fn is_good(value: &str) -> bool {
        line(format!("{{\"a\":{value}}}\n").as_bytes()).is_some()
    }

    #[test]
    fn json_nesting_depth_is_bounded() {
        let nested = |depth: usize| ["[".repeat(depth), "]".repeat(depth)].concat();
        assert!(is_good(&nested(MAX_DEPTH - 1)));
        assert!(!is_good(&nested(MAX_DEPTH)));
        assert!(!is_good(&"[".repeat(100_000)));
    }

    #[test]
    fn invalid_json_is_refused() {
        for value in [
            "",
            "{",
            "{}}",
            "{\"a\"}",
            "{\"a\":}",
            "[1,]",
            "01",
            "1.",
            ".5",
            "1e",
            "+1",
            "NaN",
            "1e999",
            "tru",
            "1 2",
            "\"\\q\"",
            "\"\t\"",
            "1{\"a\":1",
        ] {
            assert!(!is_good(value), "{value}");
        }
    }

    fn any_value() -> impl Strategy<Value = Value> {
        let leaf = prop_oneof![
            Just(Value::Null),
            any::<bool>().prop_map(Value::from),
            any::<i64>().prop_map(Value::from),
            any::<f64>().prop_map(Value::from),
            ".{0,8}".prop_map(Value::from),
        ];
        leaf.prop_recursive(4, 32, 5, |inner| {
            prop_oneof![
                proptest::collection::vec(inner.clone(), 0..5).prop_map(Value::from),
                proptest::collection::vec(("[a-z_]{1,6}", inner), 0..5)
                    .prop_map(|pairs| Value::Object(pairs.into_iter().collect())),
            ]
        })
    }

    fn any_velocity() -> impl Strategy<Value = Velocity> {
        let number = || prop_oneof![-10.0..10.0_f64, any::<f64>().prop_filter("finite", |x| x.is_finite())];
        let times = proptest::option::of([0..1_i64 << 52, 0..1_i64 << 52]);
        let against = proptest::sample::select(vec![Against::Bottom, Against::Water]);
        let rest = (against, 0..=4_u8, any::<bool>(), any::<u8>(), times);
        ([number(), number(), number()], number(), number(), rest).prop_map(
            |(velocity_mps, fom_mps, altitude_m, (against, valid_beams, is_valid, status, times_us))| {
                Velocity {
                    against,
                    velocity_mps,
                    fom_mps,
                    altitude_m,
                    valid_beams,
                    is_valid,
                    status,
                    times_us,
                }
            },
        )
    }

    proptest! {
        #![proptest_config(headrace_sensor::codec::contract::config())]

        #[test]
        fn json_of_an_independent_writer_is_accepted(value in any_value(), pretty in any::<bool>()) {
            let text = if pretty { serde_json::to_string_pretty(&value) } else { serde_json::to_string(&value) };
            prop_assert!(is_good(&text.unwrap()));
        }

        #[test]
        fn accepted_json_is_valid_for_an_independent_parser(
            value in any_value(),
            at in any::<prop::sample::Index>(),
            byte in any::<u8>(),
            cut in any::<bool>(),
        ) {
            let mut text = format!("{{\"a\":{value}}}").into_bytes();
            let at = at.index(text.len());
            if cut { text.remove(at); } else { text[at] = byte; }
            let wanted = serde_json::from_slice::<Value>(&text).is_ok_and(|value| value.is_object());
            prop_assert_eq!(line(&text).is_some(), wanted, "{:?}", text);
        }

        #[test]
        fn fields_match_an_independent_parser(velocity in any_velocity()) {
            let line = velocity.encode();
            let value: Value = serde_json::from_slice(&line).unwrap();
            let got = decode_all(&mut LineCodec::default(), &line)[0];
            for (key, got) in ["vx", "vy", "vz"].into_iter().zip(got.velocity_mps) {
                prop_assert_eq!(value[key].as_f64(), Some(got));
            }
            prop_assert_eq!(value["fom"].as_f64(), Some(got.fom_mps));
            prop_assert_eq!(value["altitude"].as_f64(), Some(got.altitude_m));
            prop_assert_eq!(value["status"].as_u64(), Some(u64::from(got.status)));
            prop_assert_eq!(value["time_of_validity"].as_i64(), got.times_us.map(|times| times[0]));
        }
    }

    headrace_sensor::codec_contract!(
        contract,
        codec: LineCodec::default(),
        values: any_velocity(),
        encode: Velocity::encode,
        frames: [EXAMPLE],
    );
}
