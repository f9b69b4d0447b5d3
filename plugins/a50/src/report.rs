//! Lines of the device: each a JSON object and a newline. Velocity reports are read, others are good lines without use.
//!
//! Source: Water Linked, "DVL A50/A125 TCP JSON API", json_v3 to json_v3.3.

use headrace_sensor::codec::{Framed, Framing, Verdict};
use headrace_sensor::geometry::math;
use serde::{Deserialize, Serialize};

use crate::json::Cursor;

/// The longest line that is taken. A velocity report has about 1,100 bytes.
pub const MAX_LINE_BYTES: usize = 4096;

/// What the velocity is against.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Against {
    /// The ground, or a wall.
    Bottom,
    /// Layers of water.
    Water,
}

/// A velocity report, in the device's units and axes: x forward, y right, z down (towards where it looks).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Velocity {
    /// What it is against.
    pub against: Against,
    /// Velocity, m/s.
    pub velocity_mps: [f64; 3],
    /// Figure of merit: how far the velocity may be off, m/s.
    pub fom_mps: f64,
    /// Distance to what reflects, along z, m.
    pub altitude_m: f64,
    /// Beams that are valid.
    pub valid_beams: u8,
    /// Whether the device itself holds velocity and altitude for valid.
    pub is_valid: bool,
    /// Status bits: 1 for too hot; others are not defined.
    pub status: u8,
    /// When the sound was reflected, and when the report was sent; microseconds of the device's own clock.
    pub times_us: Option<[i64; 2]>,
}

impl Velocity {
    /// The line that says so, of the fields that are read.
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

/// A line that is an object.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Line {
    Velocity(Velocity),
    Other,
}

/// What has been found of a velocity report.
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
    /// Takes the value of a key. One of an unexpected type is no report.
    fn take(&mut self, key: &[u8], value: &mut Cursor<'_>) -> Option<()> {
        let [x, y, z] = &mut self.velocity_mps;
        let [validity, transmission] = &mut self.times_us;
        match key {
            b"vx" => *x = Some(value.number()?),
            b"vy" => *y = Some(value.number()?),
            b"vz" => *z = Some(value.number()?),
            b"fom" => self.fom_mps = Some(value.number()?),
            b"altitude" => self.altitude_m = Some(value.number()?),
            b"transducers" => self.valid_beams = Some(valid_beams(value)?),
            b"velocity_valid" => self.is_valid = Some(value.boolean()?),
            b"status" => self.status = Some(u8::try_from(math::round_to_i64(value.number()?)).ok()?),
            b"time_of_validity" => *validity = Some(math::round_to_i64(value.number()?)),
            b"time_of_transmission" => *transmission = Some(math::round_to_i64(value.number()?)),
            b"type" => {
                self.against = Some(match value.text()? {
                    b"velocity_water" => Against::Water,
                    _ => Against::Bottom,
                });
            }
            _ => value.skip()?,
        }
        Some(())
    }

    /// The report, where all of it was there.
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

fn valid_beams(transducers: &mut Cursor<'_>) -> Option<u8> {
    let mut valid = 0_u8;
    transducers.array(&mut |beam| {
        beam.object(&mut |key, value| {
            match key {
                b"beam_valid" => valid = valid.checked_add(u8::from(value.boolean()?))?,
                _ => value.skip()?,
            }
            Some(())
        })
    })?;
    Some(valid)
}

/// Whether the object's `type` is one of the velocity reports; `None` where it is no object.
fn is_velocity(line: &[u8]) -> Option<bool> {
    let (mut is_velocity, mut cursor) = (false, Cursor::new(line)?);
    cursor.object(&mut |key, value| {
        if key == b"type" {
            is_velocity = matches!(value.text()?, b"velocity" | b"velocity_water");
            return Some(());
        }
        value.skip()
    })?;
    cursor.is_at_end().then_some(is_velocity)
}

fn line(line: &[u8]) -> Option<Line> {
    if !is_velocity(line)? {
        return Some(Line::Other);
    }
    let mut found = Found::default();
    Cursor::new(line)?.object(&mut |key, value| found.take(key, value))?;
    found.whole().map(Line::Velocity)
}

/// How lines stand in a stream of bytes. A velocity report that lacks something is no good line.
#[derive(Debug, Clone, Copy, Default)]
pub struct Lines;

/// Bytes of the connection to velocity reports.
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

    use super::*;

    /// The maker's example of a report, on one line.
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
    fn the_makers_example_is_read() {
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
    fn other_lines_are_good_and_say_nothing() {
        let mut codec = LineCodec::default();
        let lines = [POSITION, RESPONSE, "{}\n", EXAMPLE].concat();
        assert_eq!(decode_all(&mut codec, lines.as_bytes()).len(), 1);
        assert_eq!(codec.counts(), CodecCounts { good_frames: 4, ..CodecCounts::default() });
    }

    #[test]
    fn a_report_that_lacks_something_is_no_good_line() {
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
    fn a_line_without_end_holds_no_more_than_its_room() {
        let endless = [b"{\"".to_vec(), vec![b'a'; 3 * MAX_LINE_BYTES]].concat();
        let mut codec = LineCodec::default();
        let got = decode_all(&mut codec, &[&endless, EXAMPLE.as_bytes()].concat());
        assert_eq!((got.len(), codec.counts().skipped_bytes), (1, endless.len() as u64));
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
        fn fields_are_those_that_another_reader_finds(velocity in any_velocity()) {
            let line = velocity.encode();
            let value: serde_json::Value = serde_json::from_slice(&line).unwrap();
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
