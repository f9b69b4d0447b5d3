//! True holes as the oracle computes them match the results of another program, which shares no code with the oracle or
//! with headrace.

use std::path::Path;
use std::process::Command;

use headrace_oracle::second;
use headrace_oracle::wall::{Place, Wall};
use headrace_tests::{root, skipped};

/// The wall with the samples and the perimeter from `tests/oracles/holes_truth.csv`.
fn committed() -> Wall {
    let text = std::fs::read_to_string(root().join("tests/oracles/holes_truth.csv")).unwrap();
    let (first, rest) = text.split_once('\n').unwrap();
    let perimeter_m = first.split_once('=').unwrap().1.trim().parse().unwrap();
    let place = |line: &str| -> Place {
        let (x, arc) = line.split_once(',').unwrap();
        [x.parse().unwrap(), arc.parse().unwrap()]
    };
    Wall::new(rest.lines().skip(1).map(place), perimeter_m).unwrap()
}

/// Start, end and hole diameter D of each section in a table, m.
fn holes(table: &str) -> Vec<[f64; 3]> {
    let row = |line: &str| -> [f64; 3] {
        let cells: Vec<f64> = line.split(',').map(|cell| cell.parse().unwrap()).collect();
        cells.try_into().unwrap()
    };
    table.lines().skip(1).map(row).collect()
}

#[test]
fn true_holes_match_an_independent_program() {
    let wall = committed();
    let expected = holes(&std::fs::read_to_string(root().join("tests/oracles/holes.csv")).unwrap());
    assert_eq!(expected.len(), 12);
    for [from_m, to_m, hole_m] in expected {
        let found_m = wall.hole_m(from_m, to_m);
        assert!((found_m - hole_m).abs() < 1e-9, "{from_m} to {to_m} m: {found_m} m, not {hole_m} m");
        let second_m = second::hole_m(&wall, from_m, to_m);
        assert!((second_m - hole_m).abs() < 1e-9, "{from_m} to {to_m} m: {second_m} m, not {hole_m} m");
    }
}

#[test]
fn independent_program_reproduces_the_committed_table_of_holes() {
    let script = root().join("tests/oracles/holes.py");
    let has_scipy = Command::new("python3").args(["-c", "import scipy"]).output();
    if !has_scipy.is_ok_and(|output| output.status.success()) {
        return skipped("python3 with scipy is not there; the table of holes wasn't made again");
    }
    let output = Command::new("python3").arg::<&Path>(&script).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let expected = holes(&std::fs::read_to_string(root().join("tests/oracles/holes.csv")).unwrap());
    let found = holes(&String::from_utf8(output.stdout).unwrap());
    assert_eq!(found.len(), expected.len());
    for (found, expected) in found.iter().flatten().zip(expected.iter().flatten()) {
        assert!((found - expected).abs() < 1e-9, "{found}, not {expected}");
    }
}
