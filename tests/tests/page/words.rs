//! The page's table of displayed words equals the program's table, and has words for every code of the live state.

use headrace_monitor::page_words::table;
use headrace_tests::root;
use serde_json::Value;

/// The page's table, as a path below the repository's root.
const TABLE: &str = "plugins/dashboard/page/src/text/table.ts";
/// Environment variable that makes this test rewrite the table.
const RENEW: &str = "HEADRACE_RENEW_WORDS";

/// To rewrite the table, run `HEADRACE_RENEW_WORDS=1 cargo test -p headrace_tests --test page words`.
#[test]
fn displayed_words_of_the_page_equal_those_of_the_program() {
    let path = root().join(TABLE);
    if std::env::var_os(RENEW).is_some() {
        std::fs::write(&path, table()).unwrap();
    } else {
        let written = std::fs::read_to_string(&path).unwrap();
        assert_eq!(written, table(), "{TABLE} differs from the program; renew it with {RENEW}=1");
    }
}

#[test]
fn displayed_words_of_the_page_cover_every_code_of_the_schema() {
    let schema: Value =
        serde_json::from_str(include_str!("../../../docs/reference/live-state.schema.json")).unwrap();
    let table = table();
    for (name, place) in [
        ("CONDITIONS", "/state/properties/condition"),
        ("POSITION_WHY", "/state/properties/position/properties/why"),
        ("REASONS", "/state/properties/reason"),
        ("SENSOR_STATES", "/sensor/properties/state"),
        ("PRIORITIES", "/listed_alert/properties/priority"),
    ] {
        let (_, rest) = table.split_once(&format!("export const {name} = {{\n")).unwrap();
        let (object, _) = rest.split_once("} as const").unwrap();
        let mut codes: Vec<&str> =
            object.lines().map(|line| line.trim().split_once(':').unwrap().0).collect();
        let wanted = schema.pointer(&format!("/$defs{place}/enum")).unwrap().as_array().unwrap();
        let mut wanted: Vec<&str> = wanted.iter().filter_map(Value::as_str).collect();
        codes.sort_unstable();
        wanted.sort_unstable();
        assert_eq!(codes, wanted, "{name}");
    }
}
