//! Output of a dive on terminals of several widths and in a pipe.

use headrace_tests::Folder;
use headrace_tests::pty::{OnTerminal, shown_lines};
use serde_json::Value;

/// The dive starts inside the tunnel, is too fast over a stretch, turns back, and goes on. At its end all heads die.
const SCENE: &str = "seed = 3\nvehicle = \"vita2-4.toml\"\n[vehicle_changes]\nheads.planned_speed_mps = 0.09\n[trajectory]\nstart_m = 3\n
[[trajectory.legs]]\ndistance_m = 3\nspeed_mps = 0.09\n
[[trajectory.legs]]\ndistance_m = 3\nspeed_mps = 0.4\n
[[trajectory.legs]]\ndistance_m = 15\nspeed_mps = 0.09\n[effects]\n
[[effects.device_faults]]\nkind = \"die\"\nsensors = [\"sonar_0\", \"sonar_1\", \"sonar_2\", \"sonar_3\"]\nfrom_s = 190\n";

fn dive() -> Folder {
    let folder = Folder::new();
    folder.write("vita2-4.toml", include_str!("../../../deploy/vehicles/vita2-4.toml"));
    folder.write("scene.toml", SCENE);
    folder.simulate("scene.toml", "dive.mcap");
    folder
}

fn on_terminal(folder: &Folder, columns: u16) -> String {
    let mut command = headrace_tests::program();
    command.arg("replay").arg(folder.path("dive.mcap")).args(["--speed", "max"]);
    OnTerminal::start(command, columns).all()
}

#[test]
fn no_line_wraps_on_terminals_of_60_to_200_columns() {
    let folder = dive();
    for columns in [60, 100, 200] {
        let written = on_terminal(&folder, columns);
        let lines = shown_lines(&written);
        let wide: Vec<_> = lines.iter().filter(|line| line.chars().count() >= usize::from(columns)).collect();
        assert!(wide.is_empty(), "{columns} columns: {wide:#?}");
        for what in ["TOO FAST", "MISSED", "NOT INSPECTED", "NO SONAR", "ok up to"] {
            assert!(lines.iter().any(|line| line.contains(what)), "{columns} columns, {what}: {lines:#?}");
        }
    }
}

#[test]
fn status_is_red_while_too_fast_and_green_otherwise() {
    let written = on_terminal(&dive(), 100);
    let statuses: Vec<&str> = written.split("\r\x1b[K").skip(1).collect();
    let coloured = |code: &str, what: &str| {
        let of: Vec<_> = statuses.iter().filter(|status| status.contains(what)).collect();
        assert!(!of.is_empty() && of.iter().all(|status| status.starts_with(code)), "{what}: {of:#?}");
    };
    coloured("\x1b[1;31m", "TOO FAST");
    coloured("\x1b[32m", "ok up to");
    coloured("\x1b[1;31m", "NO SONAR");
}

#[test]
fn piped_output_has_no_colours_and_no_broken_lines() {
    let folder = dive();
    let answer = folder.headrace(&["replay", "dive.mcap"]);
    assert!(!answer.stdout.contains(['\x1b', '\r']));
    let missed = answer.stdout.lines().find(|line| line.contains("MISSED: too fast")).unwrap();
    assert!(missed.contains(" -> inspect again from "), "{missed}");
    insta::assert_snapshot!(answer.stdout.split("digest").next().unwrap());
}

/// The pilot slows down, but then heads die. The wall is therefore still missed, but for another cause. The stretch
/// remains a single missed stretch, and the new cause is announced too.
#[test]
fn missed_stretch_is_announced_again_when_its_cause_changes() {
    let folder = dive();
    let dying = "sensors = [\"sonar_0\", \"sonar_1\", \"sonar_2\"]\nfrom_s = 42\nfor_s = 70\n";
    let [kept, _] = SCENE.split("sensors =").collect::<Vec<_>>()[..] else { panic!("{SCENE}") };
    folder.write("scene.toml", format!("{kept}{dying}"));
    folder.simulate("scene.toml", "silent.mcap");
    let answer = folder.headrace(&["replay", "silent.mcap", "--json-lines"]);
    let lines = answer.stdout.lines().map(|line| serde_json::from_str::<Value>(line).unwrap());
    let flags: Vec<Value> = lines.filter(|line| line["type"] == "flag").collect();
    let (_, report) = folder.replay("silent.mcap", &[]);
    let runs = report["runs"].as_array().unwrap();
    let kept: Vec<_> = runs.iter().filter(|run| run["merged_into"].is_null()).collect();
    let [run] = kept[..] else { panic!("{runs:#?}") };
    let causes: Vec<_> = flags.iter().map(|flag| flag["cause"].as_str().unwrap()).collect();
    assert_eq!(causes, ["too_fast", "head_silent"], "{flags:#?}");
    let from_m = |flag: &Value| flag["from_m"].as_f64().unwrap();
    assert!(from_m(&flags[1]) > from_m(&flags[0]) + 1.0, "{flags:#?}");
    for flag in &flags {
        assert_eq!(flag["run"], run["id"]);
        assert!(run["causes"].as_array().unwrap().contains(&flag["cause"]), "{run}");
    }
    let actions = &report["go_back"][0]["actions"];
    assert!(
        ["slower", "head_back"].iter().all(|action| actions.as_array().unwrap().contains(&(*action).into()))
    );
}

#[test]
fn json_lines_have_the_state_every_second_and_each_event_once() {
    let folder = dive();
    let answer = folder.headrace(&["replay", "dive.mcap", "--json-lines"]);
    let lines: Vec<Value> = answer.stdout.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    let schema: Value =
        serde_json::from_str(include_str!("../../../docs/reference/live-state.schema.json")).unwrap();
    for line in &lines {
        let faults = headrace_tests::json_schema::faults(&schema, line);
        assert!(faults.is_empty(), "{line:#}: {faults:#?}");
    }
    let of = |kind: &str| lines.iter().filter(|line| line["type"] == kind).collect::<Vec<_>>();
    let (_, report) = folder.replay("dive.mcap", &[]);
    let states = of("state");
    let times: Vec<f64> = states.iter().map(|state| state["now_s"].as_f64().unwrap()).collect();
    assert!(times.windows(2).all(|pair| pair[1] - pair[0] < 1.05), "{times:?}");
    for state in &states {
        let metres = &state["metres"];
        let m = |key: &str| metres[key].as_f64().unwrap();
        let sum = m("pass_m") + m("fail_m") + m("cannot_say_m") + m("open_m") + m("not_inspected_m");
        assert!((sum - m("way_m")).abs() < 1e-9, "{metres}");
    }
    let runs = report["runs"].as_array().unwrap();
    assert_eq!(of("flag").len(), runs.len(), "{runs:#?}");
    assert!(of("not_inspected").len() == 1 && of("end").len() == 1);
    assert_eq!(lines.last().unwrap()["type"], "end");
    assert_eq!(lines.last().unwrap()["digest"], report["digest"]);
}
