//! `headrace setup`: finds the attached devices, asks for tunnel, target and mounts, and writes and checks a vehicle
//! file.

mod devices;
mod questions;
mod rules;
mod vehicle_text;

use std::path::Path;

use crate::check;
use crate::cli::{self, Setup};
use crate::failure::Failure;
use crate::files;
use crate::logging::complain;
use crate::output::{say, show};
use crate::outputs::{Claims, Kind};
use crate::tunnel_option;
use crate::vehicle_file;
use devices::FoundDevice;
use questions::{Question, Questions};
use vehicle_text::{Answers, has_direction, is_head};

/// Mode that every head gets until the best mode is known.
const ANY_MODE: &str = "slow";
/// Name of the file of additional udev rules. It differs from the package's name, because udev ignores a file of the
/// package if a file with the same name is in /etc.
const RULES_FILE: &str = "71-headrace-local.rules";

/// Runs `headrace setup`. Returns the exit code of the file's check.
pub(crate) fn setup(args: &Setup) -> Result<u8, Failure> {
    let tunnel_file = args.tunnel.as_deref().and_then(tunnel_option::file);
    Claims::reading(tunnel_file, &args.overwrite).claim("--out", &args.out, Kind::Vehicle)?;
    let load = files::beside(&args.out);
    if let Some(tunnel) = &args.tunnel {
        tunnel_option::parse(tunnel, &load)?;
    }
    let mut questions = Questions::new(args.yes);
    let devices = devices::find(args, &mut questions)?;
    let answers = answers(args, &devices, &mut questions)?;
    questions.complete()?;
    let Some(answers) = answers else { return Err(Failure::Usage("setup: an answer is missing".to_owned())) };
    let written = |mode: &str, planned_mps| vehicle_text::text(&answers, &devices, mode, planned_mps);
    // If the user has given the mode of a head, the other heads get the same mode.
    let given = devices.iter().filter(|device| is_head(device)).find_map(|head| head.value("mode"));
    let mut text = written(given.unwrap_or(ANY_MODE), None);
    let parse = |text: &str| vehicle_file::parse(&args.out.display().to_string(), text, &load);
    let mode = if given.is_some() { check::planned_mode } else { check::best_mode };
    if let Some((mode, planned_mps)) = mode(parse(&text)?, &text) {
        text = written(mode, Some(planned_mps));
        parse(&text)?;
    }
    files::write(&args.out, text.as_bytes())?;
    say(&format!("vehicle {}", args.out.display()));
    let code = check::file(&args.out)?;
    show_missing_rules(&devices);
    say(&format!("next: headrace check {} --devices", args.out.display()));
    Ok(code)
}

/// The answers about tunnel, target and mounts; `None` if one is missing.
fn answers(
    args: &Setup,
    devices: &[FoundDevice],
    questions: &mut Questions,
) -> Result<Option<Answers>, Failure> {
    let load = files::beside(&args.out);
    let tunnel_of = |text: &str| {
        let parsed = tunnel_option::parse(text, &load).map_err(|failure| failure.to_string())?;
        Ok((text.to_owned(), parsed))
    };
    let question = Question {
        text: "Tunnel: ceran, circle,radius_m=2, rectangle,width_m=4,height_m=3, arch, trimmed_circle, or a .csv file",
        option: "--tunnel circle,radius_m=2",
        suggestion: None,
    };
    let given = args.tunnel.as_deref().and_then(|tunnel| tunnel_of(tunnel).ok());
    let tunnel = given.map_or_else(|| questions.ask(&question, tunnel_of), |tunnel| Ok(Some(tunnel)))?;
    let question =
        Question { text: "Length of the tunnel, metres", option: "--length METRES", suggestion: None };
    let in_tunnel = tunnel.as_ref().and_then(|(text, _)| tunnel_option::length(text));
    let given = args.length.or(in_tunnel.and_then(|text| text.parse().ok()));
    let length_m = given.map_or_else(|| questions.ask(&question, cli::length), |given| Ok(Some(given)))?;
    let question = Question {
        text: "Target: smallest feature that must be found, metres",
        option: "--target METRES",
        suggestion: None,
    };
    let target_m =
        args.target.map_or_else(|| questions.ask(&question, cli::target), |given| Ok(Some(given)))?;
    let known = |id: &String| devices.iter().any(|device| device.id == *id);
    if let Some((unknown, _)) = args.mount.iter().find(|(id, _)| !known(id)) {
        let ids: Vec<&str> = devices.iter().map(|device| device.id.as_str()).collect();
        return Err(Failure::Usage(format!(
            "--mount {unknown}: no such device; expected one of {}",
            ids.join(", ")
        )));
    }
    let mut mounts = Vec::new();
    for device in devices {
        mounts.push(mount(args, device, questions)?);
    }
    let all = tunnel.zip(length_m).zip(target_m);
    Ok(all.map(|((tunnel, length_m), target_m)| Answers { tunnel, length_m, target_m, mounts }))
}

/// Mount of a device. That of a sonar is required. The direction of an inertial unit or DVL matters, too, and is asked for
/// on a terminal. For other devices the origin is usually good enough.
fn mount(
    args: &Setup,
    device: &FoundDevice,
    questions: &mut Questions,
) -> Result<Option<[[f64; 3]; 2]>, Failure> {
    let given = args.mount.iter().find(|(id, _)| *id == device.id).map(|(_, mount)| *mount);
    let is_sonar = is_head(device) || device.plugin == "ping1d";
    let is_asked = questions.has_terminal() && !args.yes;
    if given.is_some() || !(is_sonar || has_direction(device)) {
        return Ok(given);
    }
    if !is_sonar && !is_asked {
        complain(&format!(
            "headrace: warning: {id} ({}): its direction isn't given, so the file has zero angles; give it with --mount \
             {id}=ROLL,PITCH,YAW",
            device.connect,
            id = device.id
        ));
        return Ok(None);
    }
    let text = format!(
        "Mount of {} ({}): metres forward, left and up, and ahead, aft, left, right, up or down; such as 0.3,0,-0.1,ahead; \
         or roll, pitch and yaw, degrees",
        device.id, device.connect
    );
    let option = format!("--mount {}=X,Y,Z,DIRECTION", device.id);
    questions.ask(&Question { text: &text, option: &option, suggestion: None }, cli::mount)
}

/// Shows the missing udev rules, as a command that installs them.
fn show_missing_rules(devices: &[FoundDevice]) {
    let missing = rules::missing(devices.iter().map(|device| &device.connect), Path::new("/"));
    if !missing.is_empty() {
        show(&format!(
            "this computer lacks udev rules for these devices; install them as root:\ncat >> /etc/udev/rules.d/{RULES_FILE} \
             <<'END'\n{}\nEND\nudevadm control --reload && udevadm trigger\n",
            missing.join("\n")
        ));
    }
}
