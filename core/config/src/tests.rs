//! Tests of the reader of TOML files.

use super::document::Document;
use super::reader::NamedFile;

const TEXT: &str = "target_m = 0.5\n[water]\nsound_speed_mps = 14470\nsalt = 1\n";

#[test]
fn config_error_names_file_line_key_value_and_allowed_values() {
    let root = Document::new("v.toml", TEXT).root().unwrap();
    assert_eq!(root.number("target_m", 0.0..=1.0).unwrap(), Some(0.5));
    let water = root.section("water").unwrap().unwrap();
    let error = water.number("sound_speed_mps", 1300.0..=1600.0).unwrap_err();
    assert_eq!(
        error.to_string(),
        "v.toml:3: water.sound_speed_mps = 14470: must be a number from 1300 to 1600"
    );
    let error = water.finish().unwrap_err();
    assert_eq!(error.to_string(), "v.toml:4: water.salt: is not a key here; known are sound_speed_mps");
}

#[test]
fn error_names_the_line_of_a_missing_key_or_invalid_toml() {
    let root = Document::new("v.toml", "\n[water]\n").root().unwrap();
    let water = root.section("water").unwrap().unwrap();
    let error =
        water.required("density_kgpm3", water.number("density_kgpm3", 0.0..=1.0).unwrap()).unwrap_err();
    assert_eq!(error.to_string(), "v.toml:2: water.density_kgpm3: is missing");
    assert_eq!(Document::new("v.toml", "a = 1\nb = \n").root().unwrap_err().line, 2);
}

#[test]
fn file_referenced_by_a_key_is_read() {
    let files = |name: &str| match name {
        "a.dbc" => Ok("text".to_owned()),
        _ => Err("isn't there".to_owned()),
    };
    let text = "file = \"a.dbc\"\n[inner]\nfile = \"a.dbc\"\nother = \"b.dbc\"\n";
    let root = Document::new("v.toml", text).root().unwrap();
    let error = root.named_file("file").unwrap_err().to_string();
    assert_eq!(error, "v.toml:1: file = \"a.dbc\": names a file, but files are not allowed here");
    let root = root.with_files(&files);
    let expected = NamedFile { name: "a.dbc".to_owned(), text: "text".to_owned() };
    let inner = root.section("inner").unwrap().unwrap();
    assert_eq!(root.named_file("file").unwrap(), Some(expected.clone()));
    assert_eq!(inner.named_file("file").unwrap(), Some(expected));
    assert_eq!(root.named_file("none").unwrap(), None);
    let error = inner.named_file("other").unwrap_err().to_string();
    assert_eq!(error, "v.toml:4: inner.other = \"b.dbc\": isn't there");
}

#[test]
fn value_that_is_not_a_number_is_rejected() {
    let root = Document::new("v.toml", "a = nan\nb = inf\nc = \"1\"\nd = [1, 2]\n").root().unwrap();
    for key in ["a", "b", "c"] {
        assert!(root.number(key, f64::MIN..=f64::MAX).is_err(), "{key}");
    }
    assert!(root.triple("d", -1.0..=9.0).is_err());
}

#[test]
fn all_errors_are_found_in_one_pass() {
    let text = "taget_m = 3\ncolour = 1\n[water]\nsound_speed_mps = 14470\nsalt = 1\n[[parts]]\nid = 7\nrate_hz = 2\n\
                [[parts]]\nid = \"b\"\nrate_hz = 0\n";
    let errors = Document::new("v.toml", text).read(|root| {
        let target_m = root.number("target_m", 0.0..=1.0)?;
        let water = root.section("water")?.unwrap();
        let water = root.part(|| {
            let speed = water.number("sound_speed_mps", 1300.0..=1600.0)?;
            water.finish()?;
            Ok(speed)
        })?;
        assert_eq!(water, None, "a table with an error is discarded");
        for part in root.sections("parts")? {
            root.part(|| {
                let id = part.text("id")?;
                // An error about the absent value is not reported if it follows from an earlier error.
                part.number("rate_hz", 1.0..=9.0)?.ok_or_else(|| part.invalid("rate_hz", "is needed"))?;
                part.required("id", id)
            })?;
        }
        root.finish()?;
        root.required("target_m", target_m)
    });
    insta::assert_snapshot!(errors.unwrap_err(), @"
    v.toml:1: taget_m: is not a key here; did you mean target_m?
    v.toml:2: colour: is not a key here; known are target_m, water, parts
    v.toml:4: water.sound_speed_mps = 14470: must be a number from 1300 to 1600
    v.toml:5: water.salt: is not a key here; known are sound_speed_mps
    v.toml:7: parts[0].id = 7: must be a text in quotes
    v.toml:11: parts[1].rate_hz = 0: must be a number from 1 to 9
    ");
}

#[test]
fn error_about_an_unknown_key_names_the_known_keys() {
    let read = Document::new("v.toml", "a = 1\n").read(|root| root.number("a", 0.0..=1.0));
    assert_eq!(read, Ok(Some(1.0)));
    let unread = Document::new("v.toml", "a = 1\nb = 2\n").read(|root| root.number("a", 0.0..=1.0));
    assert_eq!(unread.unwrap_err().to_string(), "v.toml:2: b: is not a key here; known are a");
}

#[test]
fn error_about_an_unknown_word_suggests_a_similar_word() {
    let root = Document::new("v.toml", "profile = \"cercle\"\n").root().unwrap();
    let error = root.choice("profile", &[("arch", 1), ("circle", 2)]).unwrap_err();
    assert_eq!(
        error.to_string(),
        "v.toml:1: profile = \"cercle\": must be one of arch, circle; did you mean \"circle\"?"
    );
}

#[test]
fn every_line_of_invalid_toml_is_reported() {
    let errors = Document::new("v.toml", "a = = 1\nb = 2\nc = \"x\n[d\n").read(|_| Ok(())).unwrap_err();
    let lines: Vec<usize> = errors.errors().iter().map(|error| error.line).collect();
    assert_eq!(lines, [1, 3, 4], "{errors}");
}

#[test]
fn line_of_a_key_is_found_by_its_path() {
    let text = "a = 1\n[b]\nc = 2\n[[d]]\ne = 3\n[[d]]\ne = 4\nf = { g = 5 }\n";
    let line = |path: &str| Document::new("v.toml", text).line_of(path);
    for (path, expected) in [
        ("a", 1),
        ("b", 2),
        ("b.c", 3),
        ("b.none", 2),
        ("d[1].e", 7),
        ("d[1].none", 6),
        ("d[1].f.g", 8),
        ("none", 1),
    ] {
        assert_eq!(line(path), expected, "{path}");
    }
}
