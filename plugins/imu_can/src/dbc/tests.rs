//! DBC mappings compared with the presets; worked examples; error texts; invalid DBC texts.

use std::sync::LazyLock;

use headrace_sensor::SensorConfig;
use headrace_sensor::config::{Document, NamedFile};
use headrace_sensor::device::{Decoder, Device, DeviceKind as _, Emulated, EmulatorSetup};
use headrace_sensor::geometry::frames::{Mount, Rot, Vec3};
use headrace_sensor::geometry::site::Site;
use headrace_sensor::geometry::time::{DurNs, MonoNs};
use headrace_sensor::measurement::Inertia;
use headrace_sensor::reading::{Decoded, Packet, Reading};
use proptest::prelude::*;

use super::decoder::DbcDecoder;
use super::file::{DbcError, DbcFile};
use super::keys;
use super::mapping::Mapping;
use crate::ImuCanKind;
use crate::codec::MessageSet;
use crate::decoder::{AxisOrder, DecoderSettings, ImuDecoder};
use crate::frame::{CanFrame, CanId, FrameKind};
use crate::sets::xsens;

const XSENS: &str = include_str!("../../dbc/xsens_mti600.dbc");
const SBG: &str = include_str!("../../dbc/sbg_ellipse.dbc");

const XSENS_KEYS: &str = r#"
[signals]
rate = ["GyroX", "GyroY", "GyroZ"]
force = ["AccX", "AccY", "AccZ"]
quaternion = ["QuatW", "QuatX", "QuatY", "QuatZ"]
attitude_valid = { signal = "StatusWord", mask = 0x2 }
force_valid = { signal = "StatusWord", mask = 0x700, value = 0 }
rate_valid = { signal = "StatusWord", mask = 0x3800, value = 0 }
sample_time = "SampleTime"
"#;

const SBG_KEYS: &str = r#"
axes = "frd"
[signals]
rate = ["GyroX", "GyroY", "GyroZ"]
force = ["AccX", "AccY", "AccZ"]
quaternion = ["QuatW", "QuatX", "QuatY", "QuatZ"]
force_valid = { signal = "ImuStatus", mask = 0x11D }
rate_valid = { signal = "ImuStatus", mask = 0x2E1 }
sample_time = "ImuTime"
"#;

/// DBC text that also has the other content of files for whole vehicles, such as comments and value tables.
const RICH: &str = "VERSION \"1\"\n\nNS_ :\n\tNS_DESC_\n\tCM_\n\tBA_DEF_\n\nBS_:\n\nBU_: U H\n\
VAL_TABLE_ OnOff 1 \"on\" 0 \"off\" ;\n\n\
BO_ 2147483748 A: 8 U\n SG_ Rate : 7|16@0- (0.01,-1) [-10|10] \"deg/s\" Vector__XXX\n\
 SG_ Page M : 16|8@1+ (1,0) [0|3] \"\" H,U\n SG_ Deep m1 : 24|8@1+ (1,0) [0|255] \"\" H\n\n\
BO_TX_BU_ 2147483748 : U,H;\n\
EV_ Env: 0 [0|1] \"\" 0 1 DUMMY_NODE_VECTOR0 H;\n\
CM_ SG_ 2147483748 Rate \"of the unit;\nand more\";\n\
BA_DEF_ BO_ \"GenMsgCycleTime\" INT 0 65535;\nBA_DEF_ SG_ \"Gain\" FLOAT 0 1;\nBA_DEF_ \"Kind\" ENUM \"a\",\"b\";\n\
BA_DEF_DEF_ \"GenMsgCycleTime\" 10;\nBA_DEF_DEF_ \"Gain\" 0.5;\nBA_DEF_DEF_ \"Kind\" \"a\";\n\
BA_ \"GenMsgCycleTime\" BO_ 2147483748 20;\nBA_ \"Kind\" 1;\nBA_ \"Gain\" SG_ 2147483748 Rate 0.25;\n\
VAL_ 2147483748 Page 1 \"one\" 0 \"nil\" ;\n\
SIG_GROUP_ 2147483748 Group 1 : Rate Page;\nSG_MUL_VAL_ 2147483748 Deep Page 1-1;\n";

const LATENCY: DurNs = DurNs::from_millis(3);

fn mapped(dbc: &str, own: &str) -> Result<Mapping, String> {
    let file = NamedFile { name: "imu.dbc".to_owned(), text: dbc.to_owned() };
    let root = Document::new("v.toml", own).root().unwrap();
    let mapping = keys::mapping(&file, &root, LATENCY).map_err(|error| error.to_string())?;
    root.finish().map_err(|error| error.to_string())?;
    Ok(mapping)
}

fn with_euler(own: &str) -> String {
    own.replace(r#"quaternion = ["QuatW", "QuatX", "QuatY", "QuatZ"]"#, r#"euler = ["Roll", "Pitch", "Yaw"]"#)
}

fn preset(set: MessageSet) -> ImuDecoder {
    let tick = DurNs(100_000);
    ImuDecoder::new(DecoderSettings {
        set,
        axis_order: AxisOrder::Yxz,
        sample_time_tick: tick,
        latency: LATENCY,
    })
}

fn frame(id: u16, data: &[u8]) -> [u8; 16] {
    CanFrame::of_kind(FrameKind::Data(CanId::Standard(id)), data).unwrap().encode()
}

fn decoded(decoder: &mut dyn Decoder, received: MonoNs, bytes: &[u8]) -> Vec<Decoded> {
    let mut readings = Vec::new();
    decoder.decode(Packet { received, bytes }, &mut |decoded| readings.push(decoded));
    readings
}

/// Packets: frames of the maker's set with random content, some of them with a wrong length, and foreign frames.
fn frames(ids: &'static [(u16, usize)]) -> impl Strategy<Value = Vec<Vec<u8>>> {
    let own = (0..ids.len(), any::<[u8; 8]>(), 0_u8..16, 0_usize..9).prop_map(|(which, data, odd, other)| {
        let (id, bytes) = ids[which];
        frame(id, &data[..if odd == 0 { other } else { bytes }]).to_vec()
    });
    // Sparse data has many zero bytes, as in real frames, so that validity states change and some quaternions are zero.
    let sparse = (0..ids.len(), any::<[u8; 8]>(), any::<u8>()).prop_map(|(which, data, keep)| {
        let (id, bytes) = ids[which];
        let mut data = data;
        for (place, byte) in data.iter_mut().enumerate() {
            *byte = if keep >> place & 1 == 1 { *byte } else { 0 };
        }
        frame(id, &data[..bytes]).to_vec()
    });
    let other = proptest::collection::vec(any::<u8>(), 0..40);
    proptest::collection::vec(prop_oneof![8 => own, 4 => sparse, 1 => other], 0..200)
}

const XSENS_IDS: [(u16, usize); 6] = [(0x05, 4), (0x06, 2), (0x11, 4), (0x32, 6), (0x34, 6), (0x51, 2)];
const XSENS_QUATERNION: [(u16, usize); 5] = [(0x21, 8), (0x11, 4), (0x05, 4), (0x32, 6), (0x34, 6)];
const XSENS_EULER: [(u16, usize); 5] = [(0x22, 6), (0x11, 4), (0x05, 4), (0x32, 6), (0x34, 6)];
const SBG_QUATERNION: [(u16, usize); 4] = [(0x120, 8), (0x121, 6), (0x122, 6), (0x131, 8)];
const SBG_EULER: [(u16, usize); 4] = [(0x120, 8), (0x121, 6), (0x122, 6), (0x132, 6)];

/// Asserts that DBC decoder and preset give equal readings (bit for bit), withheld counts and clocks.
fn same(mapping: &Mapping, set: MessageSet, packets: &[Vec<u8>], heard: &[(u16, usize)]) -> usize {
    let (mut ours, mut presets) = (DbcDecoder::new(mapping), preset(set));
    let mut readings = 0;
    for (number, bytes) in packets.iter().enumerate() {
        let received = MonoNs(1_000_000_000 + number as u64 * 1_000_003);
        let by_dbc = decoded(&mut ours, received, bytes);
        let by_preset = decoded(&mut presets, received, bytes);
        assert_eq!(by_dbc, by_preset, "{bytes:02X?}");
        readings += by_dbc.len();
    }
    assert_eq!(ours.withheld(), presets.withheld());
    assert_eq!(ours.clock().filter(|clock| clock.stamps > 0), presets.clock());
    if heard.is_empty() {
        assert_eq!(ours.counts(), presets.counts());
    } else {
        // The DBC decoder doesn't check the length of frames outside its mapping, so it may count fewer bad frames.
        assert!(ours.counts().bad_frames <= presets.counts().bad_frames);
    }
    readings
}

static MAPPINGS: LazyLock<[(Mapping, MessageSet); 4]> = LazyLock::new(|| {
    let set = MessageSet::Xsens(xsens::Ids { base: None });
    [
        (mapped(XSENS, XSENS_KEYS).unwrap(), set),
        (mapped(XSENS, &with_euler(XSENS_KEYS)).unwrap(), set),
        (mapped(SBG, SBG_KEYS).unwrap(), MessageSet::Sbg),
        (mapped(SBG, &with_euler(SBG_KEYS)).unwrap(), MessageSet::Sbg),
    ]
});

proptest! {
    #[test]
    fn dbc_and_preset_agree_for_xsens(
        quaternions in frames(&XSENS_QUATERNION), angles in frames(&XSENS_EULER), others in frames(&XSENS_IDS),
    ) {
        let [(by_quaternion, set), (by_euler, _), ..] = &*MAPPINGS;
        same(by_quaternion, *set, &quaternions, &[]);
        same(by_euler, *set, &angles, &[]);
        same(by_quaternion, *set, &others, &XSENS_IDS);
    }

    #[test]
    fn dbc_and_preset_agree_for_sbg(
        quaternions in frames(&SBG_QUATERNION), angles in frames(&SBG_EULER),
    ) {
        let [_, _, (by_quaternion, set), (by_euler, _)] = &*MAPPINGS;
        same(by_quaternion, *set, &quaternions, &[]);
        same(by_euler, *set, &angles, &[]);
    }

    /// Truncated texts, texts with changed bytes, and arbitrary texts give an error or a result, but never a panic.
    #[test]
    fn arbitrary_text_is_parsed_without_a_panic(
        cut in 0_usize..4000, changes in proptest::collection::vec((0_usize..4000, any::<char>()), 0..4),
        any in "\\PC*", which in 0_usize..4,
    ) {
        let whole = [XSENS, SBG, OTHERS, RICH][which];
        let mut text: Vec<char> = whole.chars().collect();
        for (place, change) in changes {
            if let Some(char) = text.get_mut(place) {
                *char = change;
            }
        }
        let text: String = text.into_iter().take(cut).collect();
        for text in [text.as_str(), any.as_str(), &format!("{text}{any}")] {
            if let Ok(dbc) = DbcFile::parse(text) {
                for name in ["GyroX", "QuatW", "ImuInfo.ImuTime", "AX", "Low", "F64", "Rate", "Deep"] {
                    let _found = dbc.signal(name);
                }
            }
        }
    }

    /// The numeric fields of a valid DBC text are replaced by out-of-range numbers.
    #[test]
    fn arbitrary_numbers_are_parsed_without_a_panic(
        id: u64, bytes: u64, start: u64, size: u64, order in 0_u8..2, factor in any::<f64>(), mux in 0_u64..5,
    ) {
        let signal = format!("SG_ A m{mux} : {start}|{size}@{order}- ({factor:e},0) [0|0] \"deg/s\" H");
        let switch = " SG_ S M : 0|8@1+ (1,0) [0|0] \"\" H\n";
        let text = format!("BU_: H\nBO_ {id} Message: {bytes} H\n{switch} {signal}\n");
        if let Ok(found) = DbcFile::parse(&text).and_then(|dbc| dbc.signal("A")) {
            prop_assert!(bytes <= 8 && (1..=64).contains(&size));
            let _value = found.place.value(found.place.id, [0xA5; 8]);
        }
    }
}

#[test]
fn readings_by_a_dbc_file_equal_those_by_the_preset_of_the_device() {
    let [(mapping, set), ..] = &*MAPPINGS;
    let packets: Vec<Vec<u8>> = [
        frame(0x05, &[0, 0, 0x27, 0x10]),
        frame(0x11, &[0, 0, 0, 2]),
        frame(0x21, &[0x76, 0x41, 0, 0, 0, 0, 0x30, 0xFB]),
        frame(0x32, &[0, 0, 0, 0, 2, 0]),
        frame(0x34, &[0, 0, 0, 0, 0x09, 0xCF]),
    ]
    .map(|frame| frame.to_vec())
    .to_vec();
    assert_eq!(same(mapping, *set, &packets, &[]), 3);
    let mut decoder = DbcDecoder::new(mapping);
    let readings: Vec<Reading> = packets
        .iter()
        .flat_map(|bytes| decoded(&mut decoder, MonoNs(5_000_000), bytes))
        .map(|d| d.reading)
        .collect();
    let Reading::Attitude(attitude) = readings[0] else { panic!() };
    assert!((attitude.roll_pitch_yaw().2.to_degrees() - 44.998).abs() < 5e-4);
    assert_eq!(readings[1], Reading::AngularRate(Vec3::new(0.0, 0.0, 1.0)));
    assert_eq!(readings[2], Reading::SpecificForce(Vec3::new(0.0, 0.0, 9.808_593_75)));
}

#[test]
fn vector_with_a_clipped_axis_is_withheld() {
    let [(mapping, set), ..] = &*MAPPINGS;
    let (rate, force) = (frame(0x32, &[0; 6]), frame(0x34, &[0; 6]));
    for bit in 0..32_u32 {
        let status = frame(0x11, &(1_u32 << bit | 2).to_be_bytes());
        let packets = [status, rate, force].map(|frame| frame.to_vec());
        let expected = if (8..=13).contains(&bit) { 1 } else { 2 };
        assert_eq!(same(mapping, *set, &packets, &[]), expected, "bit {bit}");
    }
}

/// Worked examples in the layouts of other makers: MM5.10 with offsets and three frames, and J1939's slope of 24 bits.
const OTHERS: &str = "VERSION \"\"\nBU_: U H\n\
BO_ 112 TX1: 8 U\n SG_ YawRate : 0|16@1+ (0.005,-163.84) [0|0] \"deg/s\" H\n SG_ AY : 32|16@1+ (0.000127465,-4.1768) [0|0] \"g\" H\n\
BO_ 128 TX2: 8 U\n SG_ RollRate : 0|16@1+ (0.005,-163.84) [0|0] \"°/s\" H\n SG_ AX : 32|16@1+ (0.000127465,-4.1768) [0|0] \"g\" H\n\
BO_ 1398 TX3: 8 U\n SG_ AZ : 32|16@1+ (0.000127465,-4.1768) [0|0] \" G \" H\n SG_ AX : 0|8@1+ (1,0) [0|0] \"V\" H\n\
BO_ 2364549504 SSI2: 8 U\n SG_ Pitch : 0|24@1+ (3.0517578125e-05,-250) [0|0] \"deg\" H\n SG_ Roll : 24|24@1+ (3.0517578125e-05,-250) [0|0] \"deg\" H\n\
BO_ 600 Float: 8 U\n SG_ F32 : 7|32@0- (1,0) [0|0] \"rad/s\" H\n SG_ Page M : 39|8@0+ (1,0) [0|0] \"\" H\n SG_ Low m0 : 47|16@0- (0.5,0) [0|0] \"rad/s\" H\n SG_ High m1 : 47|16@0- (0.5,0) [0|0] \"rad/s\" H\n\
BO_ 601 Double: 8 U\n SG_ F64 : 0|64@1- (1,0) [0|0] \"furlong\" H\n SG_ Bad : 60|8@1- (1,0) [0|0] \"\" H\n SG_ Nil : 0|8@1- (0,0) [0|0] \"\" H\n\
BO_ 602 Fd: 64 U\n SG_ InFd : 0|8@1- (1,0) [0|0] \"\" H\n\
BO_ 70000 Far: 8 U\n SG_ InFar : 0|8@1- (1,0) [0|0] \"\" H\n\
SIG_VALTYPE_ 600 F32 : 1;\nSIG_VALTYPE_ 601 F64 : 2;\nSIG_VALTYPE_ 601 Bad : 1;\n";

#[test]
fn vector_in_several_frames_is_reported_when_its_last_frame_arrives() {
    let own = "[signals]\nforce = [\"TX2.AX\", \"AY\", \"AZ\"]\n";
    let mut decoder = DbcDecoder::new(&mapped(OTHERS, own).unwrap());
    let half_g = [0, 0, 0, 0, 0x53, 0x8F, 0, 0];
    let mut at = 0;
    let mut send = |id, wait_ms: u64| {
        at += wait_ms * 1_000_000;
        decoded(&mut decoder, MonoNs(at), &frame(id, &half_g))
    };
    assert_eq!((send(0x80, 10).len(), send(0x70, 1).len()), (0, 0));
    let got = send(0x576, 1);
    let Reading::SpecificForce(force) = got[0].reading else { panic!() };
    assert!([force.x(), force.y(), force.z()].iter().all(|mps2| (mps2 - 0.5 * 9.806_65).abs() < 1e-3));
    assert_eq!(got[0].valid_at, MonoNs(9_000_000));
    // After a lost frame, the components that have arrived must not be combined with the next sample. The sample after
    // the gap is complete.
    assert_eq!((send(0x80, 10).len(), send(0x70, 1).len()), (0, 0));
    assert_eq!((send(0x80, 10).len(), send(0x70, 1).len(), send(0x576, 1).len()), (0, 0, 1));
    assert_eq!(decoder.withheld(), 0);
    let mut send = |id, wait_ms: u64| {
        at += wait_ms * 1_000_000;
        decoded(&mut decoder, MonoNs(at), &frame(id, &half_g)).len()
    };
    assert_eq!([send(0x70, 10), send(0x576, 1)], [0, 0]);
    assert_eq!([send(0x80, 10), send(0x70, 1), send(0x576, 1)], [0, 0, 1]);
    assert_eq!(decoder.withheld(), 1);
}

#[test]
fn worked_examples_of_makers_without_a_preset_are_decoded() {
    let dbc = DbcFile::parse(OTHERS).unwrap();
    let value = |name: &str, data: [u8; 8]| {
        let place = dbc.signal(name).unwrap().place;
        place.value(place.id, data)
    };
    let near = |got: Option<f64>, expected: f64| assert!((got.unwrap() - expected).abs() < 1e-9, "{got:?}");
    near(value("YawRate", [0xD0, 0x87, 0, 0, 0x53, 0x8F, 0, 0]), 10.0);
    let slope = [0, 0xC0, 0x7D, 0, 0xE0, 0x7B, 0, 0];
    near(value("Pitch", slope), 1.5);
    near(value("Roll", slope), -2.25);
    assert_eq!(dbc.signal("Pitch").unwrap().place.id, CanId::Extended(0x0CF0_2980));
    near(value("F32", [0xC0, 0x20, 0, 0, 0, 0, 0, 0]), -2.5);
    near(value("F64", (-0.1_f64).to_le_bytes()), -0.1);
    // A frame of page 0 has the signal Low, a frame of page 1 the signal High.
    let page = |page| [0, 0, 0, 0, page, 0xFF, 0xFE, 0];
    assert_eq!((value("Low", page(0)), value("High", page(0))), (Some(-1.0), None));
    assert_eq!((value("Low", page(1)), value("High", page(1))), (None, Some(-1.0)));
    assert_eq!((value("Low", page(2)), value("High", page(2))), (None, None));
}

#[test]
fn dbc_content_other_than_signals_is_ignored() {
    let dbc = DbcFile::parse(&format!("\u{FEFF}{}", RICH.replace('\n', "\r\n"))).unwrap();
    let place = dbc.signal("Rate").unwrap().place;
    assert_eq!(place.id, CanId::Extended(100));
    assert!((place.value(place.id, [0xFF, 0x9C, 0, 0, 0, 0, 0, 0]).unwrap() + 2.0).abs() < 1e-12);
    assert_eq!(dbc.signal("Deep"), Err(DbcError::Multiplexed { signal: "Deep".to_owned() }));
}

#[test]
fn non_finite_values_are_withheld() {
    let own = "[signals]\nrate = [\"F32\", \"F32\", \"F32\"]\n";
    let mut decoder = DbcDecoder::new(&mapped(OTHERS, own).unwrap());
    let mut send = |value: f32| {
        let [a, b, c, d] = value.to_be_bytes();
        decoded(&mut decoder, MonoNs(5_000_000), &frame(600, &[a, b, c, d, 0, 0, 0, 0])).len()
    };
    assert_eq!([send(1.5), send(f32::NAN), send(f32::INFINITY), send(-0.5)], [1, 0, 0, 1]);
    assert_eq!(decoder.withheld(), 2);
}

#[test]
fn errors_name_the_fault_and_the_allowed_values() {
    let dbc = DbcFile::parse(OTHERS).unwrap();
    let error = |name: &str| dbc.signal(name).unwrap_err().to_string();
    let none = error("GyroX");
    assert!(
        none.starts_with(
            "looking for the signal \"GyroX\": the DBC has none of that name; it has YawRate, AY,"
        )
    );
    assert_eq!(
        error("AX"),
        "looking for the signal \"AX\": it is in several messages; name one of TX2.AX, TX3.AX"
    );
    assert!(error("Bad").contains("bits 60|8@1 extend beyond the end of its frame of 8 bytes"));
    assert!(error("InFd").contains("frame of 64 bytes"));
    assert!(error("Nil").contains("factor 0, offset 0"));
    assert!(error("InFar").contains("identifier 70000"));
    let short = OTHERS.replace("60|8@1-", "0|8@1-");
    let float = DbcFile::parse(&short).unwrap().signal("Bad").unwrap_err();
    assert_eq!(float, DbcError::Float { signal: "Bad".to_owned(), size: 8 });
    assert!(matches!(DbcFile::parse(&" ".repeat((1 << 20) + 1)), Err(DbcError::Long(_))));

    let error = |own: &str| mapped(OTHERS, own).unwrap_err();
    assert_eq!(error(""), "v.toml:1: signals: is missing");
    assert!(error("[signals]\n").contains("at least one of rate, force, quaternion, euler is needed"));
    let two = error("[signals]\nrate = [\"YawRate\", \"RollRate\"]\n");
    assert!(
        two.starts_with("v.toml:2: signals.rate = [") && two.ends_with("must be the names of 3 signals"),
        "{two}"
    );
    let unit = error("[signals]\nforce = [\"F64\", \"AY\", \"AZ\"]\n");
    assert!(unit.contains("its unit is \"furlong\"; allowed are \"m/s^2\", "), "{unit}");
    let rate = "[signals]\nrate = [\"YawRate\", \"YawRate\", \"YawRate\"]\n";
    assert!(mapped(OTHERS, rate).is_ok());
    let more = |key: &str| error(&format!("{rate}{key}\n"));
    assert!(more("valid = { signal = \"Page\", mask = 0x100 }").contains("mask 0x100, value"));
    assert!(more("valid = { signal = \"Page\", mask = 1, value = 2 }").contains("value 0x2;"));
    assert!(more("valid = { signal = \"F32\", mask = 1 }").contains("using \"Float.F32\" as a state"));
    assert!(more("valid = { signal = \"Page\" }").contains("signals.valid.mask: is missing"));
    assert!(more("sample_time = \"AY\"").contains("a step of 0.000127465 \"g\""));
    assert!(more("heading = \"AY\"").contains("is not a key here"));
    assert!(error(&format!("axes = \"ned\"\n{rate}")).contains("must be one of flu, frd"));
}

#[test]
fn invalid_dbc_is_refused_with_its_line() {
    let line = |text: &str| match DbcFile::parse(text) {
        Err(DbcError::Parse { line, problem }) => (line, problem),
        other => panic!("{other:?}"),
    };
    let (number, problem) = line(&OTHERS.replace("SG_ AY : 32|16@1+", "SG_ AY : 32|16@2+"));
    assert_eq!(number, 5, "{problem}");
    assert!(problem.contains("SG_ AY : 32|16@2+"), "{problem}");
    assert_eq!(line("VERSION \"\"\n\n<html>\n").0, 3);
    let far = OTHERS.replace("BO_ 70000 Far", "BO_ 99999999999 Far");
    let far_line = 1 + far.lines().position(|line| line.contains("Far")).unwrap();
    assert_eq!(line(&far).0, far_line);
    let error = mapped("BO_ x\n", "[signals]\n").unwrap_err();
    assert_eq!(error, "imu.dbc:1: DBC: \"BO_ x\" is not valid DBC");
}

fn configured(own: &str) -> Result<Box<dyn Device>, String> {
    let load = |name: &str| match name {
        "xsens.dbc" => Ok(XSENS.to_owned()),
        "sbg.dbc" => Ok(SBG.to_owned()),
        "others.dbc" => Ok(OTHERS.to_owned()),
        _ => Err("isn't there".to_owned()),
    };
    let sensor = SensorConfig {
        id: "imu".to_owned(),
        plugin: "imu_can".to_owned(),
        connect: "can:can0".to_owned(),
        mount: Mount { position: Vec3::zero(), rotation: Rot::identity() },
        latency: LATENCY,
    };
    let root = Document::new("v.toml", own).root().unwrap().with_files(&load);
    let device = ImuCanKind.configure(&sensor, &root).map_err(|error| error.to_string())?;
    root.finish().map_err(|error| error.to_string())?;
    assert_eq!(device.specification().sensor, sensor);
    Ok(device)
}

#[test]
fn readings_decoded_with_a_dbc_match_the_motion_of_the_emulated_unit() {
    let paged = "[signals]\nrate = [\"Low\", \"F32\", \"High\"]\n".to_owned();
    let cases = [
        ("xsens.dbc", XSENS, XSENS_KEYS.to_owned(), 3),
        ("xsens.dbc", XSENS, with_euler(XSENS_KEYS), 3),
        ("sbg.dbc", SBG, SBG_KEYS.to_owned(), 3),
        ("sbg.dbc", SBG, with_euler(SBG_KEYS), 3),
        ("others.dbc", OTHERS, paged, 1),
    ];
    for (name, text, own, readings) in cases {
        let device = configured(&format!("rate_hz = 50\ndbc = {name:?}\n{own}")).unwrap();
        let setup =
            EmulatorSetup { start: MonoNs(7_000_000), head: None, site: Site::default(), polled: true };
        let Emulated::Inertial(mut emulator) = device.emulator(&setup) else { panic!() };
        let mut decoder = DbcDecoder::new(&mapped(text, &own).unwrap());
        let mut due = Vec::new();
        emulator.begin(MonoNs(10_000_000_000), &mut due);
        assert_eq!(due.len(), 500);
        for inertia in due {
            let felt = Inertia {
                attitude: Rot::from_roll_pitch_yaw(0.1, -0.2, 1.3),
                rate_radps: Vec3::new(0.5, -1.0, 1.5),
                force_mps2: Vec3::new(0.3, -0.4, 9.7),
                ..inertia
            };
            let mut got = Vec::new();
            emulator.tell(&felt, &mut |_, at, bytes| got.extend(decoded(&mut decoder, at, bytes)));
            assert_eq!(got.len(), readings, "{name} {own}");
            for decoded in got {
                assert_eq!(decoded.valid_at, inertia.at);
                match decoded.reading {
                    Reading::Attitude(got) => {
                        let [w, ..] = (got.inverse() * felt.attitude).wxyz();
                        assert!(w.abs() > 1.0 - 1e-7, "{w}");
                    }
                    Reading::AngularRate(got) => assert!((got + -felt.rate_radps).norm() < 2e-3, "{got:?}"),
                    Reading::SpecificForce(got) => assert!((got + -felt.force_mps2).norm() < 2e-2, "{got:?}"),
                    other => panic!("{other:?}"),
                }
            }
        }
        assert_eq!((decoder.withheld(), decoder.passed_over(), decoder.counts().bad_frames), (0, 0, 0));
        if readings == 3 {
            let drift = decoder.clock().unwrap().drift.unwrap();
            assert!(drift.ppm.abs() < 5.0 * drift.sd_ppm, "{drift:?}");
        }
    }
}

#[test]
fn vehicle_file_names_either_a_dbc_or_a_preset() {
    let error = |own: &str| configured(own).err().unwrap();
    assert_eq!(error("dbc = \"gone.dbc\"\n"), "v.toml:1: dbc = \"gone.dbc\": isn't there");
    assert!(error("preset = \"sbg_ellipse\"\ndbc = \"sbg.dbc\"\n").contains("is given beside preset"));
    assert!(error("preset = \"sbg_ellipse\"\naxes = \"frd\"\n").contains("is not a key here"));
    assert!(error(&format!("dbc = \"sbg.dbc\"\nid_base = 0\n{SBG_KEYS}")).contains("is not a key here"));
}
