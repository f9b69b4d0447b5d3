use headrace_sensor::codec::Codec as _;
use proptest::prelude::*;

use super::*;

const EXAMPLE_1: [u8; 27] = [
    0xFE, 0x44, 0x10, 0x0A, 0, 0, 0x43, 0, 0x14, 0x01, 0x14, 0x3C, 0x78, 0x03, 0x0A, 0x03, 0, 0, 0, 0x19,
    0x08, 0x06, 0x01, 0, 0, 0x64, 0xFD,
];
const EXAMPLE_2: [u8; 27] = [
    0xFE, 0x44, 0x10, 0x03, 0, 0, 0x43, 0, 0x0A, 0x01, 0x3C, 0x3C, 0x78, 0x08, 0x02, 0x02, 0, 0, 0, 0x32,
    0x08, 0x06, 0, 0, 0, 0xA5, 0xFD,
];

fn example_1() -> Command {
    Command {
        head_id: 0x10,
        range_m: 10,
        reverse: false,
        start_gain_db: 20.0,
        logf_db: 20.0,
        absorption_dbpm: 0.2,
        train_deg: 0.0,
        sector_deg: 360.0,
        step_deg: 0.9,
        pulse_us: 100.0,
        min_range_m: 0.3,
        points: Points::P250,
        data_bits: 8,
        profile: true,
        calibrate: false,
        switch_delay_ms: 0.0,
        frequency_khz: 675.0,
    }
}

#[test]
fn worked_example_1_encodes_and_decodes() {
    assert_eq!(example_1().encode(), Ok(EXAMPLE_1));
    assert_eq!(Command::decode(&EXAMPLE_1), Ok(example_1()));
}

#[test]
fn worked_example_2_encodes_and_decodes() {
    let command = Command {
        range_m: 3,
        start_gain_db: 10.0,
        absorption_dbpm: 0.6,
        step_deg: 2.4,
        pulse_us: 20.0,
        min_range_m: 0.2,
        points: Points::P500,
        profile: false,
        frequency_khz: 1000.0,
        ..example_1()
    };
    assert_eq!(command.encode(), Ok(EXAMPLE_2));
    assert_eq!(Command::decode(&EXAMPLE_2), Ok(command));
}

#[test]
fn step_is_rounded_not_truncated() {
    // The step is slightly below 0.9 degrees, because 0.9 / 0.3 in single precision is slightly less than 3.
    let step_deg = f64::from(0.9_f32) - 1e-6;
    assert_eq!(Command { step_deg, ..example_1() }.encode().unwrap()[13], 3);
    let error = Command { step_deg: 1.5, ..example_1() }.encode().unwrap_err();
    assert_eq!(
        error.to_string(),
        "switch command: step of 1.5; allowed are 0, 0.3, 0.6, 0.9, 1.2, 2.4 degrees"
    );
}

#[test]
fn unsupported_range_is_refused() {
    let error = Command { range_m: 7, ..example_1() }.encode().unwrap_err();
    assert_eq!(
        error.to_string(),
        "switch command: range of 7; allowed are 1, 2, 3, 4, 5, 10, 20, 30, 40, 50, 60, 80, 100 m"
    );
}

#[test]
fn command_terminator_occurs_only_at_the_end() {
    let early = |command: Command| match command.encode() {
        Err(CommandError::EarlyTerminator { index }) => index,
        other => panic!("{other:?}"),
    };
    assert_eq!(early(Command { head_id: 0xFD, ..example_1() }), 2);
    assert_eq!(early(Command { absorption_dbpm: 2.53, ..example_1() }), 10);
    assert_eq!(early(Command { pulse_us: 2530.0, ..example_1() }), 14);
    assert_eq!(early(Command { switch_delay_ms: 506.0, ..example_1() }), 24);
    let mut bytes = EXAMPLE_1;
    bytes[10] = 0xFD;
    assert_eq!(Command::decode(&bytes), Err(CommandError::EarlyTerminator { index: 10 }));
}

#[test]
fn value_without_a_code_is_refused() {
    let refused = |command: Command| matches!(command.encode(), Err(CommandError::Outside { .. }));
    assert!(refused(Command { start_gain_db: 41.0, ..example_1() }));
    assert!(refused(Command { logf_db: 50.0, ..example_1() }));
    assert!(refused(Command { train_deg: -182.0, ..example_1() }));
    assert!(refused(Command { frequency_khz: 1200.0, ..example_1() }));
    assert!(refused(Command { min_range_m: f64::NAN, ..example_1() }));
    assert!(refused(Command { sector_deg: f64::INFINITY, ..example_1() }));
    let mut bytes = EXAMPLE_1;
    bytes[5] = 0x80;
    assert_eq!(Command::decode(&bytes), Err(CommandError::Fixed { index: 5, got: 0x80, wanted: 0 }));
}

prop_compose! {
    fn commands()(
        head_id in 0u8..0xFD,
        range_m in proptest::sample::select(RANGES_M.to_vec()),
        switches in any::<[bool; 4]>(),
        gain in 0u8..=40,
        logf in 0u8..=3,
        absorption in 0u8..0xFD,
        train in 0u8..=120,
        sector in 0u8..=120,
        step in proptest::sample::select(STEP_CODES.to_vec()),
        pulse in 0u8..0xFD,
        min_range in 0u8..=250,
        data_bits in proptest::sample::select(vec![4u8, 8, 16]),
        delay in 0u8..0xFD,
        frequency in 21u8..=185,
    ) -> Command {
        let [reverse, profile, calibrate, fine] = switches;
        Command {
            head_id,
            range_m,
            reverse,
            start_gain_db: GAIN.value(gain),
            logf_db: LOGF.value(logf),
            absorption_dbpm: ABSORPTION.value(absorption),
            train_deg: TRAIN.value(train),
            sector_deg: SECTOR.value(sector),
            step_deg: STEP.value(step),
            pulse_us: PULSE.value(pulse),
            min_range_m: MIN_RANGE.value(min_range),
            points: if fine { Points::P500 } else { Points::P250 },
            data_bits,
            profile,
            calibrate,
            switch_delay_ms: DELAY.value(delay),
            frequency_khz: FREQUENCY.value(frequency),
        }
    }
}

headrace_sensor::codec_contract!(
    contract,
    codec: CommandCodec::default(),
    values: commands(),
    encode: |command: &Command| command.encode().unwrap(),
    frames: [EXAMPLE_1, EXAMPLE_2],
);
