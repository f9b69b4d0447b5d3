//! `headrace_experiments tables`: the paper's Tables 1 to 5 beside recomputed numbers, as text and as JSON.

#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "clippy.toml's leave for tests doesn't reach their helpers"
)]

use std::process::{Command, Output};

use serde_json::Value;

fn answer(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_headrace_experiments")).args(arguments).output().unwrap()
}

/// Runs the command, asserts success, and returns its output.
fn shown(further: &[&str]) -> String {
    let Output { status, stdout, stderr } = answer(&[&["tables"], further].concat());
    assert_eq!((status.code(), stderr.as_slice()), (Some(0), &[][..]));
    String::from_utf8(stdout).unwrap()
}

/// Collects all cells below `value`, with the path to each cell.
fn cells(path: &str, value: &Value, found: &mut Vec<(String, Value)>) {
    match value {
        Value::Object(map) if map.contains_key("printed") => found.push((path.to_owned(), value.clone())),
        Value::Object(map) => {
            for (key, inner) in map {
                cells(&format!("{path}/{key}"), inner, found);
            }
        }
        Value::Array(list) => {
            for (index, inner) in list.iter().enumerate() {
                cells(&format!("{path}/{index}"), inner, found);
            }
        }
        _ => {}
    }
}

/// The output for the given tables. Number 0 is the text before the first table.
fn said(tables: &[usize]) -> String {
    let shown = shown(&[]);
    let parts: Vec<&str> = shown.split("\n\n").collect();
    assert_eq!(parts.len(), 6);
    tables.iter().map(|table| parts[*table]).collect::<Vec<_>>().join("\n\n")
}

#[test]
fn no_line_is_wider_than_a_terminal() {
    let shown = shown(&[]);
    let widest = shown.lines().map(str::len).max();
    assert!(widest <= Some(110), "{widest:?} columns");
}

#[test]
fn tables_of_modes_are_formatted_as_text() {
    insta::assert_snapshot!(said(&[0, 1, 2]), @"
    As printed in Jorge et al., Sensors 2021, 21, 1900 (CC BY 4.0), and ours; % is by how much ours is larger.
    = the printed digits are ours rounded and ours truncated, r rounded only, t truncated only.
    A letter refers to a note below the table.

    Table 1. Overlap of neighbouring beams, zeta / theta (Eq. 22)
                600 kHz, beam 2.4 deg   1 MHz, beam 1.4 deg
      step deg  paper    ours      %    paper    ours      %
           0.3      8   8.000   0.00 =   4.67   4.667  -0.07 r
           0.6      4   4.000   0.00 =   2.33   2.333  +0.14 =
           0.9   2.67   2.667  -0.12 r   1.55   1.556  +0.36 t
           1.2      2   2.000   0.00 =   1.16   1.167  +0.57 t
           2.4      1   1.000   0.00 =      0   0.583      - a
      a  erratum: 1 MHz, 2.4 deg: printed 0; Eq. 22 gives 1.4 / 2.4 = 0.58, which is below 1: no overlap.
      b  finding: 2.67 and 4.67 are rounded, 1.55 and 1.16 truncated.

    Table 2. Samples per turn (Eq. 3) and per second, range 10 m
                                samples a turn          samples a second
      mode    step deg  turn s  paper    ours      %    paper    ours      %
      SLOW         0.3    21.6   1200    1200   0.00 =  55.55  55.556  +0.01 t
      MEDIUM       0.6    10.8    600     600   0.00 =  55.55  55.556  +0.01 t
      FAST         0.9     8.0    400     400   0.00 =     50  50.000   0.00 =
      FASTER       1.2     6.6    300     300   0.00 =  45.45  45.455  +0.01 =
      FASTEST      2.4     4.8    150     150   0.00 =  31.25  31.250   0.00 =
      a  finding: 55.55 is truncated.
    ");
}

#[test]
fn table_of_one_head_is_formatted_as_text() {
    insta::assert_snapshot!(said(&[3]), @"
    Table 3. VITA 1, one head: the baseline at 0.197 m/s, metres
                T_x                     mean T_y                T_ymin                  T_ymax
      mode      paper    ours      %    paper    ours      %    paper    ours      %    paper    ours      %
      SLOW      4.255  4.2552   0.00 =  0.029  0.0285  -1.81 c  0.013  0.0141  +8.79 d  0.014  0.0992 +608.9 b
      MEDIUM    2.128  2.1276  -0.02 r  0.057  0.0570  -0.09 r  0.026  0.0283  +8.80 d  0.203  0.1960  -3.46 e
      FAST      1.573  1.5760  +0.19 a  0.086  0.0854  -0.67 c  0.039  0.0424  +8.80 d  0.301  0.2903  -3.55 e
      FASTER    1.300  1.3002  +0.02 =  0.115  0.1139  -0.96 c  0.053  0.0566  +6.75 d  0.396  0.3824  -3.45 e
      FASTEST   0.946  0.9456  -0.04 r  0.230  0.2278  -0.96 c  0.100  0.1132  +13.2 d  0.752  0.7291  -3.04 e
      a  erratum: FAST's T_x: 0.197 m/s x 8 s = 1.576 m; 1.573 takes 7.985 s, or 0.1966 m/s.
      b  erratum: SLOW's T_ymax, 0.014, is less than its mean; Table 4 has 0.102 and 0.104.
      c  finding: p / n: the printed means of Tables 3 and 4, copied rows apart, are all those of a perimeter
         from 34.425 to 34.500 m, rounded (to 34.650 m if some are truncated). The blueprint's 34.17 m is 0.255
         m short (0.74 %), and its p / n falls short of what rounds to the printed digits: SLOW by 0.025 mm,
         FAST by 0.075 mm, FASTER by 0.600 mm, FASTEST by 1.700 mm. The stated dimensions (35.90 m) are 1.40 m
         over.
      d  erratum: Eq. 5: no one distance to the floor gives all five. 2.506 to 2.514 m give all but FASTEST's
         0.100, which takes 2.374 to 2.398 m (2.51 m: 0.105). Ours: 2.701 m, half of the height of 8.702 m less
         1.5 m of drift and 0.15 m of mounting.
      e  finding: the printed maxima, SLOW's apart, agree with Eq. 6 where its last step ends in the corner, and
         the corner is (fitted) 2.511 m below the head and 6.613 m aside; SLOW would be 0.103. Ours: rays cast
         in the blueprint's tunnel, the worst of drifts of 0 and 1.5 m either way across and up and down, and of
         headings of 0 and 15 deg either way.
    ");
}

#[test]
fn table_of_several_heads_is_formatted_as_text() {
    insta::assert_snapshot!(said(&[4]), @"
    Table 4. VITA 2, two to four heads: the baseline, metres
                 T_x / s, phase shift                     2 T_x / s, sector offset
                        at 0.197 m/s     at 0.196 m/s            at 0.197 m/s     at 0.196 m/s
      mode    s  paper    ours      %      ours      %    paper    ours      %      ours      %
      FASTEST 2  0.470  0.4728  +0.60 a  0.4704  +0.09 =  0.941  0.9456  +0.49 a  0.9408  -0.02 r
      FASTER  2  0.647  0.6501  +0.48 a  0.6468  -0.03 r  1.294  1.3002  +0.48 a  1.2936  -0.03 r
      FAST    2  0.784  0.7880  +0.51 a  0.7840   0.00 =  1.568  1.5760  +0.51 a  1.5680   0.00 =
      MEDIUM  2  1.058  1.0638  +0.55 a  1.0584  +0.04 =  2.117  2.1276  +0.50 a  2.1168  -0.01 r
      SLOW    2  2.116  2.1276  +0.55 a  2.1168  +0.04 t  4.234  4.2552  +0.50 a  4.2336  -0.01 r
      FASTEST 3  0.314  0.3152  +0.38 a  0.3136  -0.13 r  0.627  0.6304  +0.54 a  0.6272  +0.03 =
      FASTER  3  0.431  0.4334  +0.56 a  0.4312  +0.05 =  0.862  0.8668  +0.56 a  0.8624  +0.05 =
      FAST    3  0.523  0.5253  +0.45 a  0.5227  -0.06 r  1.045  1.0507  +0.54 a  1.0453  +0.03 =
      MEDIUM  3  0.706  0.7092  +0.45 a  0.7056  -0.06 r  1.411  1.4184  +0.52 a  1.4112  +0.01 =
      SLOW    3  1.411  1.4184  +0.52 a  1.4112  +0.01 =  2.822  2.8368  +0.52 a  2.8224  +0.01 =
      FASTEST 4  0.235  0.2364  +0.60 a  0.2352  +0.09 =  0.470  0.4728  +0.60 a  0.4704  +0.09 =
      FASTER  4  0.323  0.3251  +0.63 a  0.3234  +0.12 =  0.647  0.6501  +0.48 a  0.6468  -0.03 r
      FAST    4  0.392  0.3940  +0.51 a  0.3920   0.00 =  0.784  0.7880  +0.51 a  0.7840   0.00 =
      MEDIUM  4  0.529  0.5319  +0.55 a  0.5292  +0.04 =  1.058  1.0638  +0.55 a  1.0584  +0.04 =
      SLOW    4  1.058  1.0638  +0.55 a  1.0584  +0.04 =  2.117  2.1276  +0.50 a  2.1168  -0.01 r
                 mean T_y                T_ymin                  T_ymax
      mode    s  paper    ours      %    paper    ours      %    paper    ours      %
      FASTEST 2  0.230  0.2278  -0.96 c  0.100  0.1195  +19.5 d  0.745  0.7052  -5.34 e
      FASTER  2  0.115  0.1139  -0.96 c   0.05  0.0597  +19.4 d  0.391  0.3689  -5.64 e
      FAST    2  0.086  0.0854  -0.67 c  0.041  0.0448  +9.24 d  0.297  0.2800  -5.74 e
      MEDIUM  2  0.057  0.0570  -0.09 r  0.027  0.0299  +10.6 d  0.201  0.1889  -6.04 e
      SLOW    2  0.029  0.0285  -1.81 c  0.014  0.0149  +6.63 d  0.102  0.0956  -6.30 e
      FASTEST 3   0.23  0.2278  -0.96 r  0.109  0.1195  +9.63 d  0.759  0.7322  -3.53 e
      FASTER  3  0.115  0.1139  -0.96 c  0.055  0.0597  +8.59 d  0.399  0.3834  -3.90 e
      FAST    3  0.115  0.0854  -25.7 b  0.055  0.0448  -18.6 b  0.399  0.2910  -27.1 b
      MEDIUM  3  0.057  0.0570  -0.09 r  0.027  0.0299  +10.6 d  0.205  0.1964  -4.21 e
      SLOW    3  0.029  0.0285  -1.81 c  0.014  0.0149  +6.63 d  0.104  0.0994  -4.44 e
      FASTEST 4   0.23  0.2278  -0.96 r  0.109  0.1195  +9.63 d  0.759  0.7322  -3.53 e
      FASTER  4  0.115  0.1139  -0.96 c  0.055  0.0597  +8.59 d  0.399  0.3834  -3.90 e
      FAST    4  0.115  0.0854  -25.7 b  0.055  0.0448  -18.6 b  0.399  0.2910  -27.1 b
      MEDIUM  4  0.057  0.0570  -0.09 r  0.027  0.0299  +10.6 d  0.205  0.1964  -4.21 e
      SLOW    4  0.029  0.0285  -1.81 c  0.014  0.0149  +6.63 d  0.104  0.0994  -4.44 e
      a  new erratum: T_x / s and 2 T_x / s are those of 0.196 m/s throughout, where the paper says 0.197: all
         30 follow from 0.195995 to 0.196019 m/s (SLOW's 2.116 truncated from 2.1168), none from 0.197. Table
         3's, FAST apart, follow from 0.196991 to 0.197037 m/s.
      b  erratum: FAST with three and four heads: mean, min and max are FASTER's row again; FAST with two heads
         has 0.086, 0.041 and 0.297.
      c  finding: p / n: see Table 3.
      d  erratum: Eq. 5: two heads: 2.578 to 2.626 m above the floor give all but FASTEST's 0.100, which takes
         2.374 to 2.398 m. Three and four heads: 2.602 to 2.613 m give all but the copied rows. Ours: 2.851 m.
      e  finding: as in Table 3, with the corner (fitted) 2.600 m below and 6.664 m aside for two heads, 2.607 m
         and 6.749 m for three and four, where FAST would be 0.303.
    ");
}

#[test]
fn table_of_combined_distances_is_formatted_as_text() {
    insta::assert_snapshot!(said(&[5]), @"
    Table 5. T = sqrt(T_x^2 + T_y^2) of Table 4's experiments, and as predicted at 0.197 m/s, metres
      phase shift; pred.: predicted by the baseline
                 mean T                           T_min                            T_max
      mode    s  paper   ours     %  pred.     %  paper   ours     %  pred.     %  paper   ours     %  pred.     %
      FASTEST 2  0.522 0.5215 -0.09r 0.525 +0.54  0.476 0.4758 -0.04r 0.488 +2.45  0.717 0.7174 +0.06= 0.849 +18.4
      FASTER  2  0.657 0.6570 -0.01r 0.660 +0.46  0.649 0.6491 +0.01= 0.653 +0.59  0.768 0.7681 +0.02= 0.747 -2.67
      FAST    2  0.793 0.7927 -0.04r 0.793 -0.05  0.789 0.7893 +0.04= 0.789 +0.03  0.860 0.8602 +0.02= 0.836 -2.76
      MEDIUM  2  1.058 1.0576 -0.04r 1.065 +0.69  1.057 1.0566 -0.04r 1.064 +0.68  1.067 1.0672 +0.02= 1.080 +1.26
      SLOW    2  2.098 2.0982 +0.01= 2.128 +1.42  2.098 2.0981  0.00= 2.128 +1.41  2.101 2.1006 -0.02r 2.130 +1.37
      FASTEST 3  0.392 0.3918 -0.06r 0.389 -0.79  0.328 0.3280  0.00= 0.337 +2.77  0.677 0.6774 +0.05= 0.797 +17.7
      FASTER  3  0.444 0.4439 -0.03r 0.448 +0.93  0.432 0.4318 -0.05r 0.437 +1.27  0.600 0.5997 -0.06r 0.579 -3.56
      FAST    3  0.532 0.5320  0.00r 0.532 +0.04  0.527 0.5265 -0.09r 0.527 +0.05  0.639 0.6388 -0.02r 0.601 -6.02
      MEDIUM  3  0.711 0.7114 +0.05= 0.711 +0.07  0.710 0.7096 -0.06r 0.710 -0.02  0.726 0.7255 -0.06r 0.736 +1.36
      SLOW    3  1.410 1.4103 +0.02= 1.419 +0.62  1.410 1.4101 +0.01= 1.418 +0.60  1.413 1.4135 +0.03= 1.422 +0.63
      FASTEST 4  0.322 0.3217 -0.08r 0.328 +1.96  0.245 0.2453 +0.13= 0.265 +8.12  0.628 0.6282 +0.04= 0.769 +22.5
      FASTER  4  0.343 0.3425 -0.14r 0.344 +0.42  0.328 0.3280  0.00r 0.330 +0.76  0.588 0.5877 -0.05r 0.503 -14.5
      FAST    4  0.403 0.4033 +0.07= 0.403 +0.04  0.396 0.3963 +0.09= 0.397 +0.14  0.533 0.5330  0.00= 0.490 -8.10
      MEDIUM  4  0.535 0.5352 +0.03= 0.535 -0.01  0.533 0.5331 +0.02= 0.533 -0.05  0.563 0.5632 +0.04= 0.567 +0.71
      SLOW    4  1.056 1.0565 +0.05= 1.064 +0.77  1.056 1.0561 +0.01= 1.064 +0.75  1.061 1.0608 -0.02r 1.068 +0.70
      sector offset; pred.: predicted by the baseline
                 mean T                           T_min                            T_max
      mode    s  paper   ours     %  pred.     %  paper   ours     %  pred.     %  paper   ours     %  pred.     %
      FASTEST 2  0.965 0.9653 +0.04= 0.973 +0.79  0.942 0.9422 +0.02= 0.953 +1.18  1.101 1.1011 +0.01= 1.180 +7.14
      FASTER  2  1.305 1.3049 -0.01r 1.305 +0.01  1.301 1.3012 +0.02= 1.302 +0.04  1.366 1.3655 -0.03r 1.352 -1.06
      FAST    2  1.574 1.5744 +0.02= 1.578 +0.27  1.573 1.5728 -0.02r 1.577 +0.23  1.613 1.6131 +0.01= 1.601 -0.76
      MEDIUM  2  2.116 2.1158 -0.01r 2.128 +0.58  2.115 2.1153 +0.02= 2.128 +0.61  2.121 2.1207 -0.01r 2.136 +0.71
      SLOW    2  4.174 4.1741  0.00= 4.255 +1.95  4.174 4.1740  0.00= 4.255 +1.95  4.175 4.1752  0.00= 4.256 +1.95
      FASTEST 3  0.672 0.6724 +0.05= 0.670 -0.25  0.640 0.6395 -0.07r 0.642 +0.25  0.851 0.8513 +0.04= 0.966 +13.5
      FASTER  3  0.872 0.8722 +0.03= 0.874 +0.26  0.866 0.8663 +0.04= 0.869 +0.33  0.955 0.9551 +0.01= 0.948 -0.75
      FAST    3  1.007 1.0066 -0.04r 1.054 +4.68  1.004 1.0041 +0.01= 1.052 +4.74  1.057 1.0575 +0.04= 1.090 +3.14
      MEDIUM  3  1.417 1.4172 +0.01= 1.420 +0.18  1.416 1.4165 +0.03= 1.419 +0.19  1.426 1.4259  0.00r 1.432 +0.42
      SLOW    3  2.832 2.8322 +0.01= 2.837 +0.17  2.832 2.8321  0.00= 2.837 +0.17  2.834 2.8337 -0.01r 2.839 +0.16
      FASTEST 4  0.510 0.5095 -0.09r 0.525 +2.91  0.467 0.4669 -0.02r 0.488 +4.43  0.745 0.7448 -0.03r 0.872 +17.0
      FASTER  4  0.651 0.6505 -0.07r 0.660 +1.38  0.644 0.6436 -0.06r 0.653 +1.37  0.756 0.7561 +0.01= 0.755 -0.17
      FAST    4  0.794 0.7945 +0.06= 0.793 -0.17  0.791 0.7912 +0.03= 0.789 -0.22  0.860 0.8601 +0.01= 0.840 -2.32
      MEDIUM  4  1.068 1.0675 -0.04r 1.065 -0.25  1.066 1.0665 +0.04= 1.064 -0.17  1.083 1.0826 -0.03r 1.082 -0.11
      SLOW    4  2.100 2.1002 +0.01= 2.128 +1.32  2.100 2.1000  0.00= 2.128 +1.32  2.102 2.1024 +0.02= 2.130 +1.33
      a  finding: 90 of 90 cells are the printed T_x and T_y of Table 4 put together and rounded, without the
         way gone between two pings.
      b  erratum: SLOW, four heads, sectors: Table 4's experimental T_ymin of 0.001 is an order below its
         neighbours; T_min is 2.100 with it or with 0.015.
    ");
}

#[test]
fn tables_are_written_as_json() {
    let tables: Value = serde_json::from_str(&shown(&["--json"])).unwrap();
    let rows = |number: usize| tables[format!("table_{number}")]["rows"].as_array().unwrap().len();
    assert_eq!([1, 2, 3, 4, 5].map(rows), [5, 5, 5, 15, 15]);
    let counts = [10, 10, 20, 105, 180];
    for (number, count) in (1..=5).zip(counts) {
        let table = &tables[format!("table_{number}")];
        assert_eq!(table["number"], number);
        let marks: Vec<&Value> =
            table["notes"].as_array().unwrap().iter().map(|note| &note["mark"]).collect();
        let mut found = Vec::new();
        cells("", &table["rows"], &mut found);
        assert_eq!(found.len(), count);
        for (path, cell) in found {
            let (printed, ours) = (cell["printed"].as_f64().unwrap(), cell["ours"].as_f64().unwrap());
            match cell["difference_percent"].as_f64() {
                Some(percent) => assert!((ours - printed * (1.0 + percent / 100.0)).abs() < 1e-6, "{path}"),
                None => assert!(printed == 0.0, "{path}: a difference of none"),
            }
            assert!(cell["note"].is_null() || marks.contains(&&cell["note"]), "{path}: {cell}");
        }
    }
    let fast = &tables["table_4"]["rows"][7];
    assert_eq!((&fast["mode"], &fast["heads"]), (&"FAST".into(), &3.into()));
    assert_eq!(fast["t_y_mean_m"]["note"], "b");
    assert_eq!(fast["phase_t_x_m"]["at_fitting_speed"]["digits"], "rounded");
    assert_eq!(tables["table_4"]["notes"][0]["kind"], "new_erratum");
}

#[test]
fn missing_command_prints_the_available_commands() {
    let Output { status, stdout, stderr } = answer(&[]);
    assert_eq!((status.code(), stdout.as_slice()), (Some(2), &[][..]));
    insta::assert_snapshot!(String::from_utf8(stderr).unwrap(), @"
    Recompute the results of the paper on which headrace's sampling theory is based

    Usage: headrace_experiments <COMMAND>

    Commands:
      tables       Tables 1 to 5: each printed number next to the recomputed one, with notes on errors in the paper
      experiments  The simulated and real experiments (§8 and §9); takes a minute or two
      help         Print this message or the help of the given subcommand(s)

    Options:
      -h, --help     Print help
      -V, --version  Print version
    ");
}
