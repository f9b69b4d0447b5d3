//! Common conventions of command-line programs: completions, manual pages, colours, quiet, and remaining time.

use std::io::Write as _;
use std::process::{Command, Stdio};

use headrace_tests::screen::Screen;
use headrace_tests::{Folder, program, root, skipped};

/// Names of the commands that `headrace --help` lists.
fn commands(folder: &Folder) -> Vec<String> {
    let help = folder.headrace(&["--help"]).stdout;
    let (_, list) = help.split_once("Commands:\n").unwrap();
    let names =
        list.lines().take_while(|line| !line.is_empty()).filter_map(|line| line.split_whitespace().next());
    names.filter(|name| *name != "help").map(str::to_owned).collect()
}

#[test]
fn completions_know_all_commands_and_are_valid_scripts() {
    let folder = Folder::new();
    let commands = commands(&folder);
    assert!(commands.len() > 12, "{commands:?}");
    for shell in ["bash", "zsh", "fish", "elvish", "powershell"] {
        let answer = folder.headrace(&["completions", shell]);
        assert_eq!((answer.code, answer.stderr.as_str()), (Some(0), ""), "{shell}");
        for command in &commands {
            assert!(answer.stdout.contains(command.as_str()), "{shell}: {command}");
        }
        assert!(answer.stdout.contains("sound-speed"), "{shell}: options of commands");
    }
    let script = folder.headrace(&["completions", "bash"]).stdout;
    // This script completes the word "rep" as readline does.
    let asked = "\nCOMP_WORDS=(headrace rep); COMP_CWORD=1; _headrace headrace rep headrace; echo \"${COMPREPLY[*]}\"\n";
    let bash = Command::new("bash").arg("-s").stdin(Stdio::piped()).stdout(Stdio::piped()).spawn();
    let Ok(mut bash) = bash else { return skipped("no bash") };
    bash.stdin.take().unwrap().write_all((script + asked).as_bytes()).unwrap();
    let answer = bash.wait_with_output().unwrap();
    assert_eq!(String::from_utf8(answer.stdout).unwrap(), "replay\n");
    assert_eq!(folder.headrace(&["completions", "cmd"]).code, Some(2));
}

#[test]
fn every_command_has_a_manual_page() {
    let folder = Folder::new();
    let own = folder.headrace(&["man"]);
    assert_eq!((own.code, own.stderr.as_str()), (Some(0), ""));
    assert!(own.stdout.contains(".TH headrace 1"), "{}", own.stdout);
    assert_eq!(folder.headrace(&["man", "pages"]).code, Some(0));
    for command in commands(&folder) {
        let page = String::from_utf8(folder.read(&format!("pages/headrace-{command}.1"))).unwrap();
        assert!(page.contains(".SH SYNOPSIS") && page.contains(&command), "{page}");
    }
    // Manual pages can be written a second time. If another program has written a page, this page is only overwritten
    // with `--force`.
    assert_eq!(folder.headrace(&["man", "pages"]).code, Some(0));
    folder.write("pages/headrace.1", ".TH headrace 1\n");
    assert_eq!(folder.headrace(&["man", "pages"]).code, Some(2));
    assert_eq!(folder.headrace(&["man", "pages", "--force"]).code, Some(0));
}

#[test]
fn colours_appear_only_on_terminals_that_support_them() {
    let folder = Folder::with_dive();
    // The four argument lists produce help, a usage error, a replay with flags, and log messages.
    let outputs: [&[&str]; 4] = [
        &["replay", "--help"],
        &["replay", "--bad"],
        &["replay", "dive.mcap", "--target", "0.3", "-v"],
        &["check", "-v", "vehicle.toml"],
    ];
    for arguments in outputs {
        let shown = |variables: &[(&str, &str)]| Screen::run(&folder, arguments, 100, variables).end().1;
        assert!(shown(&[]).contains("\x1b["), "{arguments:?}: no colours on a terminal");
        assert!(shown(&[("NO_COLOR", "")]).contains("\x1b["), "{arguments:?}: empty means unset");
        let plain = shown(&[("NO_COLOR", "1")]);
        // Output without colours may contain only one escape sequence, which overwrites the current line.
        assert!(!plain.replace("\r\x1b[K", "").contains('\x1b'), "{arguments:?}: {plain:?}");
        let dumb = shown(&[("TERM", "dumb")]);
        assert!(!dumb.contains('\x1b'), "{arguments:?}: {dumb:?}");
        assert!(!dumb.replace("\r\n", "\n").contains('\r'), "{arguments:?}: {dumb:?}");
    }
}

#[test]
fn quiet_option_keeps_results_and_errors() {
    let folder = Folder::with_dive();
    let loud = folder.headrace(&["replay", "dive.mcap", "--target", "0.3"]);
    let quiet = folder.headrace(&["replay", "dive.mcap", "--target", "0.3", "-q"]);
    assert!(loud.stdout.contains("MISSED: "), "{}", loud.stdout);
    assert!(!quiet.stdout.contains("missed until") && !quiet.stdout.is_empty(), "{}", quiet.stdout);
    assert!(loud.stdout.ends_with(&quiet.stdout), "the summary is the same");
    let demo = folder.headrace(&["-q", "demo", "--speed", "max", "--out", "demo"]);
    assert!(!demo.stdout.contains("ok up to") && demo.stdout.contains("report "), "{}", demo.stdout);
    assert_eq!(folder.headrace(&["-q", "check", "none.toml"]).stderr.lines().count(), 1);
}

#[test]
fn commands_longer_than_2_s_show_the_remaining_time() {
    let folder = Folder::new();
    let scene = root().join("deploy/scenes/seven-kilometres.toml");
    let simulate = ["simulate", scene.to_str().unwrap(), "-o", "long.mcap"];
    let screen = Screen::run(&folder, &simulate, 100, &[]);
    screen.until(" left");
    drop(screen);
    let mut quiet = Screen::run(&folder, &[&simulate[..], &["-q", "--force"]].concat(), 100, &[]);
    std::thread::sleep(std::time::Duration::from_secs(3));
    assert_eq!(quiet.shown(), "");
    quiet.signal(rustix::process::Signal::TERM);
    quiet.end();
}

/// The report must be complete even if another process that shares stdout has made it non-blocking.
#[cfg(target_os = "linux")]
#[test]
fn report_is_complete_on_a_non_blocking_pipe() {
    use rustix::fs::{OFlags, fcntl_setfl};
    let folder = Folder::with_dive();
    let (mut reader, mut writer) = std::io::pipe().unwrap();
    fcntl_setfl(&writer, OFlags::NONBLOCK).unwrap();
    // Nearly fills the pipe, which holds 64 KiB. The spaces don't make the report invalid, because JSON allows leading
    // spaces.
    writer.write_all(&vec![b' '; 60_000]).unwrap();
    let mut command = program();
    command.args(["replay", "dive.mcap", "--json"]).current_dir(folder.path("")).stdout(writer);
    let mut replay = command.spawn().unwrap();
    // The `Command` value still holds a copy of the pipe's writing end, which would keep the pipe open.
    drop(command);
    std::thread::sleep(std::time::Duration::from_secs(2));
    let mut bytes = Vec::new();
    std::io::Read::read_to_end(&mut reader, &mut bytes).unwrap();
    assert_eq!(replay.wait().unwrap().code(), Some(0));
    let report: serde_json::Value = serde_json::from_slice(&bytes).unwrap();
    assert!(bytes.len() > 1 << 16 && report["summary"].is_object());
}

#[test]
fn report_to_a_named_pipe_is_complete_but_fails_without_a_reader() {
    use rustix::fs::{CWD, FileType, Mode, mknodat};
    let folder = Folder::with_dive();
    mknodat(CWD, folder.path("pipe"), FileType::Fifo, Mode::RUSR | Mode::WUSR, 0).unwrap();
    let replay = ["replay", "dive.mcap", "--report", "pipe"];
    let answer = folder.headrace(&replay);
    assert_eq!(answer.code, Some(1), "{}", answer.stderr);
    let said = "writing pipe: it is a pipe that no process has read within 2 s";
    assert!(answer.stderr.contains(said), "{}", answer.stderr);
    let pipe = folder.path("pipe");
    let reader = std::thread::spawn(move || std::fs::read(pipe).unwrap());
    assert_eq!(folder.headrace(&replay).code, Some(0));
    let report: serde_json::Value = serde_json::from_slice(&reader.join().unwrap()).unwrap();
    assert!(report["summary"].is_object());
}

#[cfg(target_os = "linux")]
#[test]
fn lack_of_address_space_gives_an_error_and_no_abort() {
    let folder = Folder::with_dive();
    let headrace = program();
    for limit_kib in [100_000, 150_000, 200_000] {
        let mut limited = Command::new("sh");
        let line = format!("ulimit -v {limit_kib} && exec \"$0\" replay dive.mcap");
        limited.args(["-c", &line]).arg(headrace.get_program()).current_dir(folder.path(""));
        let output = limited.output().unwrap();
        let said = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(1), "{limit_kib}: {said}");
        assert!(said.contains("MiB of address space for the dive: the system refuses it"), "{said}");
    }
    // A dive in a long tunnel needs more address space. Whatever the limit is, the dive is either refused or replayed,
    // and the program never aborts.
    folder.write("long.toml", headrace_tests::VEHICLE.replace("length_m = 100", "length_m = 20000"));
    let mut refused = 0;
    for limit_kib in [250_000, 400_000, 700_000, 1_000_000, 1_300_000, 1_700_000, 2_500_000] {
        let mut limited = Command::new("sh");
        let line = format!("ulimit -v {limit_kib} && exec \"$0\" replay dive.mcap --vehicle long.toml -q");
        limited.args(["-c", &line]).arg(headrace.get_program()).current_dir(folder.path(""));
        let output = limited.output().unwrap();
        let said = String::from_utf8(output.stderr).unwrap();
        assert!(matches!(output.status.code(), Some(0 | 1)), "{limit_kib}: {:?}: {said}", output.status);
        refused += usize::from(said.contains("MiB of address space for the dive: the system refuses it"));
    }
    assert!((3..7).contains(&refused), "{refused} of 7 limits are too small");
}

#[cfg(target_os = "linux")]
#[test]
fn unwritable_output_is_a_failure() {
    let folder = Folder::with_dive();
    folder.record("dive.mcap", "live.mcap", &[]);
    let code = |arguments: &[&str], to: Stdio| {
        let output = program().args(arguments).current_dir(folder.path("")).stdout(to).output().unwrap();
        (output.status.code(), String::from_utf8(output.stderr).unwrap())
    };
    let full = || Stdio::from(std::fs::OpenOptions::new().write(true).open("/dev/full").unwrap());
    let vehicle = root().join("deploy/vehicles/vita1.toml");
    for arguments in [
        &["replay", "live.mcap"][..],
        &["replay", "live.mcap", "-q"],
        &["replay", "live.mcap", "--json"],
        &["verify", "live.mcap"],
        &["check", "vehicle.toml"],
        &["notes", "live.mcap"],
        &["trim", "live.mcap", "-o", "part.mcap"],
        &["plan", "--vehicle", vehicle.to_str().unwrap()],
        &["simulate", "scene.toml", "--explain"],
        &["devices"],
        &["demo", "--speed", "max", "--no-page"],
        &["completions", "bash"],
        &["help"],
        &["replay", "--help"],
        &["--version"],
    ] {
        let (failed, said) = code(arguments, full());
        assert_eq!(failed, Some(1), "{arguments:?}: {said}");
        assert!(said.contains("standard output: No space left on device"), "{arguments:?}: {said}");
    }
    // A live dive succeeds even if its stdout is redirected to a full disk.
    let dive = ["run", "vehicle.toml", "--source", "dive.mcap", "--speed", "max"];
    assert_eq!(code(&dive, full()).0, Some(0));
    // If a reader closes its end of the pipe, the program must not report an error, because the reader wants no more
    // output.
    for arguments in [&["replay", "live.mcap"][..], &["replay", "live.mcap", "--json"], &["help"], &dive] {
        let (reader, writer) = std::io::pipe().unwrap();
        drop(reader);
        assert_eq!(code(arguments, writer.into()), (Some(0), String::new()), "{arguments:?}");
    }
}
