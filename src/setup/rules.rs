//! udev rules that the devices need and this computer lacks.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use headrace_sensor::connect::{Connect, SerialPort, UsbIdentity};

/// The rules of the package.
const RULES: &str = include_str!("../../deploy/udev/70-headrace.rules");
/// Folders in which udev looks for rules. A file is ignored if an earlier folder has one with its name. Source:
/// `udev(7)`.
const FOLDERS: [&str; 4] =
    ["etc/udev/rules.d", "run/udev/rules.d", "usr/lib/udev/rules.d", "lib/udev/rules.d"];
/// USB vendor id of FTDI, which makes serial adapters.
const FTDI: u16 = 0x0403;
/// Ids of the cable counter in the package's rules, which are replaced by those of the counter found.
const PACKAGED_COUNTER: &str = "0003:1209:0001";

/// Rules that these connections need and no file below `root` contains, one per line.
pub(super) fn missing<'a>(connections: impl Iterator<Item = &'a Connect>, root: &Path) -> Vec<String> {
    let installed = installed(root);
    let mut missing = Vec::new();
    for (mark, packaged) in connections.filter_map(marks) {
        let rule = RULES.lines().find(|line| !line.starts_with('#') && line.contains(packaged));
        let rule = rule.map(|rule| rule.replace(packaged, &mark));
        let is_needed = |rule: &String| !installed.contains(&mark) && !missing.contains(rule);
        missing.extend(rule.filter(is_needed));
    }
    missing
}

/// Text by which a rule for this connection is recognised, and the text that the package's rules have in its place.
fn marks(connect: &Connect) -> Option<(String, &'static str)> {
    let same = |mark: &'static str| Some((mark.to_owned(), mark));
    match connect {
        Connect::Hid(UsbIdentity { vendor, product, .. }) => {
            Some((format!("0003:{vendor:04X}:{product:04X}"), PACKAGED_COUNTER))
        }
        Connect::I2c { .. } => same("i2c-[0-9]*"),
        Connect::Can { .. } => same("can@%k.service"),
        Connect::Serial { port: SerialPort::Usb(usb), .. } if usb.vendor == FTDI => same("latency_timer"),
        Connect::Serial { port: SerialPort::Path(path), .. } if path.contains("FTDI") => {
            same("latency_timer")
        }
        _ => None,
    }
}

/// All rules that udev uses, without comments.
fn installed(root: &Path) -> String {
    let folders = FOLDERS.iter().filter_map(|folder| fs::read_dir(root.join(folder)).ok());
    let mut files = BTreeMap::new();
    for file in folders.flatten().flatten() {
        files.entry(file.file_name()).or_insert_with(|| file.path());
    }
    let mut text = String::new();
    for file in files.values().filter_map(|path| fs::read_to_string(path).ok()) {
        for line in file.lines().filter(|line| !line.trim_start().starts_with('#')) {
            text.push_str(line);
            text.push('\n');
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rules_are_missing_until_a_file_contains_them() {
        let root = std::env::temp_dir().join(format!("headrace-rules-{}", std::process::id()));
        let connections = [
            "tcp:10.0.0.1:4040",
            "hid:16c0:05df:7",
            "i2c:/dev/i2c-1:0x40",
            "can:can0",
            "can:can1",
            "serial:usb:0403:6015:D1",
            "serial:/dev/ttyAMA0",
        ]
        .map(|text| Connect::parse(text).unwrap());
        let lacking = missing(connections.iter(), &root);
        let begins = [
            "SUBSYSTEM==\"hidraw\"",
            "SUBSYSTEM==\"i2c-dev\"",
            "ACTION!=\"remove\", SUBSYSTEM==\"net\"",
            "ACTION!=\"remove\", SUBSYSTEM==\"usb-serial\"",
        ];
        assert_eq!(lacking.len(), begins.len(), "{lacking:#?}");
        for (rule, begin) in lacking.iter().zip(begins) {
            assert!(rule.starts_with(begin), "{rule}");
        }
        assert!(lacking[0].contains("KERNELS==\"0003:16C0:05DF.*\""), "{}", lacking[0]);
        let folder = root.join("usr/lib/udev/rules.d");
        fs::create_dir_all(&folder).unwrap();
        fs::write(folder.join("70-headrace.rules"), RULES).unwrap();
        let lacking = missing(connections.iter(), &root);
        assert_eq!(lacking.len(), 1, "the package's rules have another counter: {lacking:#?}");
        let own = root.join("etc/udev/rules.d");
        fs::create_dir_all(&own).unwrap();
        fs::write(own.join("71-headrace-local.rules"), &lacking[0]).unwrap();
        assert_eq!(missing(connections.iter(), &root), [""; 0]);
        fs::write(own.join("70-headrace.rules"), "").unwrap();
        let lacking = missing(connections.iter(), &root);
        fs::remove_dir_all(&root).unwrap();
        assert_eq!(lacking.len(), begins.len() - 1, "the package's file is masked: {lacking:#?}");
    }
}
