use super::call::{Call, Fate, number};
use super::merge;
use crate::testing::Dive;

const MURK: &str = "[water]\ntemperature_degc = 8\n[[water.murk]]\nfrom_m = 5\nto_m = 9\nsilt_gpl = 0.4\n\
                    [tunnel]\n[[tunnel.stretches]]\nfrom_m = 7\nto_m = 12\nlining = \"steel\"\n\
                    [cable]\ntype = \"fathom\"\nslack_m = 0.1\n[thrusters]\nrpm = 1500\naccel_mps2 = 0.3\n\
                    [[tunnel.features]]\nkind = \"side_tunnel\"\nname = \"adit\"\nchainage_m = 15\nside = \"left\"\n\
                    width_m = 2\nheight_m = 2\nlength_m = 5\n";

fn dive() -> Dive {
    let mut dive = Dive::with_heads(&[[0.3, 0.0, 0.0], [-0.3, 0.0, 0.0]]);
    for (id, plugin, keys) in [
        ("ping", "ping1d", "angles_deg = [0, 0, 90]"),
        ("depth", "bar100", ""),
        ("imu", "imu_can", "preset = \"xsens_mti600\""),
        ("tether", "tether_hid", "counts_per_metre = 2000"),
    ] {
        dive.sensors.push((id, plugin, keys.to_owned()));
    }
    Dive { seconds: 100.0, ..dive }
}

fn fates(effects: &str) -> Vec<(&'static str, Fate)> {
    dive().scene(effects).unwrap().called().iter().map(|call| (call.effect, call.fate)).collect()
}

#[test]
fn implied_effects_are_simulated_only_if_the_scene_says_so() {
    let (plain, described) = (dive().dive(""), dive().dive(MURK.split("[tunnel]").next().unwrap()));
    assert!(plain.messages == described.messages);
    assert!(dive().simulation(MURK).unwrap().added().is_empty());
    assert!(fates(MURK).iter().all(|(_, fate)| *fate == Fate::NotTaken));
}

/// If the displayed tables of the implied effects are copied into the scene, the devices send the same bytes.
#[test]
fn implied_effects_give_the_same_messages_as_named_effects() {
    let called = format!("{MURK}[effects]\ntake = \"called\"\n");
    let scene = dive().scene(&called).unwrap();
    let tables: String = scene.called().iter().map(|call| call.tables.as_str()).collect();
    assert_eq!(scene.simulated().len(), scene.called().len());
    let (as_called, as_named) = (dive().dive(&called), dive().dive(&format!("{MURK}{tables}")));
    assert!(as_called.messages == as_named.messages && !as_called.messages.is_empty());
    assert!(as_called.messages != dive().dive(MURK).messages);
    Dive { seconds: 30.0, ..dive() }.assert_slices_dont_matter(&called);
}

#[test]
fn each_description_implies_its_effects() {
    let effects =
        |text: &str| -> Vec<&'static str> { fates(text).iter().map(|(effect, _)| *effect).collect() };
    let bare = effects("");
    let expected = [
        "motion_within_turn",
        "beam_cone",
        "occlusion",
        "echo_strength",
        "interference",
        "missing_returns",
        "outliers",
        "range_noise",
        "range_quantisation",
        "depth_noise",
        "depth_steps",
        "imu_noise",
        "imu_bias",
    ];
    assert_eq!(bare, expected);
    for (text, more) in [
        ("[water]\ntemperature_degc = 12", &["sound_speed_profile"][..]),
        ("[water]\n[[water.murk]]\nfrom_m = 1\nto_m = 2\nsilt_gpl = 1", &["multipath", "near_returns"]),
        ("[water]\n[[water.leaks]]\nchainage_m = 20\nflow_m3ps = 0.5", &["current"]),
        (
            "[[tunnel.stretches]]\nfrom_m = 7\nto_m = 12\nlining = \"steel\"",
            &["multipath", "side_lobes", "magnetic_disturbance"],
        ),
        ("[[tunnel.stretches]]\nfrom_m = 7\nto_m = 12\nlining = \"rock\"", &[]),
        ("[cable]\ntype = \"fathom\"", &["tether_scale"]),
        ("[cable]\nslack_m = 0.2\nwound_by_m = 0.5", &["tether_slack", "late_winding"]),
        ("[thrusters]\nrpm = 1200\naccel_mps2 = 1", &["imu_vibration"]),
        (
            "[[tunnel.features]]\nkind = \"gate\"\nchainage_m = 9\nslot_width_m = 0.8\nslot_depth_m = 0.5",
            &["multipath"],
        ),
    ] {
        let found: Vec<&str> = effects(text).into_iter().filter(|effect| !bare.contains(effect)).collect();
        assert_eq!(found, more, "{text}");
    }
    // The leak takes half a cubic metre per second through a rectangle of 6 m by 5 m, so the current is 0.5 / 30 m/s.
    let scene = dive().scene("[water]\n[[water.leaks]]\nchainage_m = 20\nflow_m3ps = 0.5").unwrap();
    let current = scene.called().iter().find(|call| call.effect == "current").unwrap();
    let speed_mps: f64 =
        current.tables.lines().last().unwrap().strip_prefix("speed_mps = ").unwrap().parse().unwrap();
    assert!((speed_mps + 0.5 / 30.0).abs() < 1e-4, "{speed_mps}");
    assert!(current.tables.contains("from_m = 20.0\nto_m = 5000.0\n"), "{}", current.tables);
}

#[test]
fn named_effects_override_implied_effects() {
    let text = format!(
        "{MURK}[effects]\ntake = \"called\"\nleave = [\"beam_cone\"]\nrange_noise = {{ sd_m = 0.2 }}\n"
    );
    let fate = |name: &str| fates(&text).iter().find(|(effect, _)| *effect == name).map(|(_, fate)| *fate);
    assert_eq!(fate("beam_cone"), Some(Fate::Left));
    assert_eq!(fate("range_noise"), Some(Fate::Named));
    assert_eq!(fate("near_returns"), Some(Fate::Taken));
    let scene = dive().scene(&text).unwrap();
    assert!(!scene.simulated().contains(&"beam_cone") && scene.simulated().contains(&"range_noise"));
}

#[test]
fn leaving_out_an_effect_equals_not_naming_it_in_the_scene() {
    let both = "[effects]\nrange_noise = { sd_m = 0.2 }\nmissing_returns = { share = 0.2 }\n";
    let mut scene = dive().scene(both).unwrap();
    scene.leave_out(&["range_noise"]);
    let mut simulation = crate::Simulation::new(&scene).unwrap();
    let one = dive().dive("[effects]\nmissing_returns = { share = 0.2 }\n");
    for said in &one.messages {
        assert_eq!(simulation.next_message().unwrap().bytes, said.bytes);
    }
    assert!(simulation.next_message().is_none());
}

#[test]
fn second_of_two_overlapping_implied_effects_sets_their_common_keys() {
    let on = |call: Call| call.on(&["a".to_owned(), "b".to_owned()]);
    let calls = [
        on(Call::new("echo_strength", "one", &[("wall_db", number(0.0)), ("silt_gpl", number(1.0))])),
        Call::new("echo_strength", "two", &[("wall_db", number(-9.0))])
            .within([5.0, 9.0])
            .on(&["b".to_owned()]),
        on(Call::new("outliers", "one", &[("share", number(0.1))]).within([1.0, 2.0])),
        Call::new("current", "one", &[("speed_mps", number(0.1))]).within([2.0, 4.0]),
    ];
    let merged = merge::merge(&calls);
    let tables: Vec<&str> = merged.iter().map(|call| call.tables.as_str()).collect();
    assert_eq!(
        tables,
        [
            "[[effects.echo_strength]]\nsensors = [\"a\"]\nwall_db = 0.0\nsilt_gpl = 1.0\n\
             [[effects.echo_strength]]\nsensors = [\"b\"]\nto_m = 5.0\nwall_db = 0.0\nsilt_gpl = 1.0\n\
             [[effects.echo_strength]]\nsensors = [\"b\"]\nfrom_m = 5.0\nto_m = 9.0\nwall_db = -9.0\nsilt_gpl = 1.0\n\
             [[effects.echo_strength]]\nsensors = [\"b\"]\nfrom_m = 9.0\nwall_db = 0.0\nsilt_gpl = 1.0\n",
            "[[effects.outliers]]\nsensors = [\"a\", \"b\"]\nfrom_m = 1.0\nto_m = 2.0\nshare = 0.1\n",
            "[[effects.current]]\nfrom_m = 2.0\nto_m = 4.0\nspeed_mps = 0.1\n",
        ]
    );
    assert_eq!(merged[0].by, ["one", "two"]);
}

#[test]
fn impossible_descriptions_are_refused() {
    let refusal = |text: &str| dive().refusal(text);
    for (text, words) in [
        ("[tunnel]\n[[tunnel.stretches]]\nfrom_m = 1\nlining = \"steel\"", "to_m: is missing"),
        ("[tunnel]\n[[tunnel.stretches]]\nfrom_m = 1\nto_m = 4\nlining = \"tin\"", "must be one of"),
        ("[water]\n[[water.murk]]\nfrom_m = 1\nto_m = 6000\nsilt_gpl = 1", "from 0 to 5000"),
        ("[water]\nmurky = 1", "water.murky: is not a key here"),
        ("[water]\nwarmer_per_metre_degc = 1", "needs temperature_degc"),
        ("[cable]\ntype = \"rope\"", "fathom"),
        ("[thrusters]\nrpm = 900", "accel_mps2: is missing"),
        ("[effects]\nleave = [\"occlusion\"]", "only with take = \"called\""),
        ("[effects]\ntake = \"called\"\nleave = [\"fog\"]", "names \"fog\", which isn't an effect"),
        ("[effects]\ntake = \"all\"", "only"),
    ] {
        assert!(refusal(text).contains(words), "{text}: {}", refusal(text));
    }
}
