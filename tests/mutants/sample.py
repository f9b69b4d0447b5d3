#!/usr/bin/env python3
"""Runs a sample of cargo-mutants' mutants, in the copy of the sources made by tests/mutants/run.

    sample.py N SEED MINUTES [PART]

cargo-mutants lists the mutants and describes them. N of those whose name matches PART are drawn at random. `switch`
puts them all behind a switch, so that they are built only once. For each mutant, the tests of its crate run first. If
these pass, tests of dives (tests/tests) run, quick ones first, until one fails. Tests with golden files, digests or
snapshots of results are left out. Two mutants are tested at a time. The exit code is 0.
"""
import concurrent.futures
import json
import os
import pathlib
import queue
import random
import re
import shutil
import signal
import subprocess
import sys
import threading
import time

CRATES = ["geometry", "sampling", "fusion", "coverage", "monitor"]
DIVES = ["coverage", "sampling", "navigation"]
AT_A_TIME = 2
# Time limit of a set of tests: a multiple of its usual time, plus some seconds. A set that takes longer counts as
# endless.
PATIENCE, PATIENCE_S = 4, 60
# Dive tests run in sets of about this many seconds, from quick to slow tests. Tests slower than SLOWEST_S aren't run.
SETS_S = [10, 40, 100_000]
SLOWEST_S = 6.0
SWITCH = """use std::sync::LazyLock;

static ACTIVE: LazyLock<u32> = LazyLock::new(|| std::env::var("HEADRACE_MUTANT").ok().and_then(|text| text.parse().ok()).unwrap_or(0));

#[inline]
pub(crate) fn on(mutant: u32) -> bool {
    *ACTIVE == mutant
}
"""


def drawn(count, seed, part):
    """The sampled mutants, each with a number from 1, and the number of all mutants."""
    listing = ["cargo", "mutants", "--workspace", "--config", "tests/mutants/mutants.toml", "--list", "--json"]
    listed = json.loads(subprocess.run(listing, stdout=subprocess.PIPE, check=True).stdout)
    # Mutants that delete a field mostly change values that are built in tests.
    mutants = [mutant for mutant in listed if "delete field" not in mutant["name"] and re.search(part, mutant["name"])]
    chosen = random.Random(seed).sample(mutants, min(count, len(mutants)))
    for number, mutant in enumerate(chosen, 1):
        mutant["id"] = number
    return chosen, len(mutants)


def switched(mutants):
    """Put mutants behind a switch. Returns the switched ones, without those that don't compile."""
    subprocess.run(["cargo", "build", "--quiet", "--release", "--manifest-path", "tests/mutants/switch/Cargo.toml"], check=True)
    program = pathlib.Path(os.environ.get("CARGO_TARGET_DIR", "tests/mutants/switch/target"), "release", "switch")
    for crate in CRATES:
        pathlib.Path("core", crate, "src", "switched.rs").write_text(SWITCH)
        library = pathlib.Path("core", crate, "src", "lib.rs")
        # A panic that the compiler can predict is only a warning here, so that it happens at run time.
        library.write_text(f"#![allow(arithmetic_overflow, unconditional_panic)]\n{library.read_text()}\nmod switched;\n")
    files = {mutant["file"] for mutant in mutants}
    for file in files:
        shutil.copy(file, file + ".kept")
    list_file = pathlib.Path("mutants.json")
    while True:
        for file in files:
            shutil.copy(file + ".kept", file)
        list_file.write_text(json.dumps(mutants))
        told = subprocess.run([program, list_file], stdout=subprocess.PIPE, check=True)
        left_out = set(json.loads(told.stdout)) or uncompiled()
        if not left_out:
            return mutants
        mutants = [mutant for mutant in mutants if mutant["id"] not in left_out]
        print(f"{len(left_out)} left out: computed when compiled, or they don't compile", flush=True)


def uncompiled():
    """Mutants with compiler errors. An error belongs to the last mutant named before it."""
    packages = [word for crate in CRATES for word in ("-p", f"headrace_{crate}")]
    check = ["cargo", "check", "--quiet", "--keep-going", *packages, "--lib", "--message-format", "json"]
    told = subprocess.run(check, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, check=False)
    numbers = set()
    for line in told.stdout.splitlines():
        message = json.loads(line).get("message", {})
        if message.get("level") != "error":
            continue
        for span in message["spans"]:
            if span["is_primary"]:
                lines = pathlib.Path(span["file_name"]).read_text().splitlines()[: span["line_end"]]
                named = re.findall(r"switched::on\((\d+)\)", "\n".join(lines))
                numbers.add(int(named[-1]))
    if told.returncode != 0 and not numbers:
        sys.exit("the switched sources don't compile, and no mutant is named: cargo check says why")
    return numbers


def built():
    """Test programs by the names of their targets."""
    packages = [word for crate in CRATES for word in ("-p", f"headrace_{crate}")]
    own = ["cargo", "test", "--quiet", "--no-run", *packages, "--lib", "--message-format", "json"]
    dives = ["cargo", "test", "--quiet", "--no-run", "-p", "headrace_tests", "--message-format", "json"]
    dives += [word for name in DIVES for word in ("--test", name)]
    programs = {}
    for command in (own, dives):
        told = subprocess.run(command, stdout=subprocess.PIPE, check=True)
        for line in told.stdout.splitlines():
            artifact = json.loads(line)
            if artifact.get("executable") and artifact["profile"]["test"]:
                programs[artifact["target"]["name"]] = (artifact["executable"], pathlib.Path(artifact["manifest_path"]).parent)
    return programs


def run(program, words, mutant, seconds):
    """Run a test program up to its first failing test. Returns the test's name, "" if all pass, None on a timeout."""
    executable, folder = program
    environment = {**os.environ, "HEADRACE_MUTANT": str(mutant), "CARGO_MANIFEST_DIR": str(folder)}
    command = [executable, "--test-threads", "1", *words]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, cwd=folder, env=environment, start_new_session=True) as begun:
        killed = threading.Event()

        def kill():
            killed.set()
            os.killpg(begun.pid, signal.SIGKILL)

        timer = threading.Timer(seconds, kill)
        timer.start()
        failed = ""
        for line in begun.stdout:
            if line.rstrip().endswith(b"FAILED"):
                failed = line.decode().removeprefix("test ").split(" ... ")[0]
                os.killpg(begun.pid, signal.SIGKILL)
                break
        timer.cancel()
        code = begun.wait()
    if failed:
        return failed
    if killed.is_set():
        return None
    return "" if code == 0 else f"exit code {code}"


def timed(program):
    """Time of each test of a program without a mutant, s. Exits if one fails."""
    executable, folder = program
    environment = {**os.environ, "HEADRACE_MUTANT": "0", "CARGO_MANIFEST_DIR": str(folder)}
    times = {}
    with subprocess.Popen([executable, "--test-threads", "1"], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, cwd=folder, env=environment) as begun:
        at = time.monotonic()
        for line in begun.stdout:
            name, *result = line.decode().rstrip().removeprefix("test ").split(" ... ")
            if result == ["ok"]:
                times[name], at = time.monotonic() - at, time.monotonic()
            elif result == ["FAILED"]:
                sys.exit(f"{name} fails without a mutant")
    return times


def times_of(programs):
    """Times of all tests of several programs, by program; cached for the next run in the same folder."""
    kept = pathlib.Path("..", "times.json")
    if kept.exists():
        return json.loads(kept.read_text())
    with concurrent.futures.ThreadPoolExecutor(AT_A_TIME) as pool:
        times = dict(zip(programs, pool.map(timed, programs.values())))
    kept.write_text(json.dumps(times))
    return times


def sets(times):
    """Arguments for each set of dive tests, with its time, s; quick sets first."""
    each = [(seconds, program, name) for program, all_of in times.items() for name, seconds in all_of.items()]
    result, left = [], sorted(test for test in each if test[0] <= SLOWEST_S)
    print(f"{len(left)} of {len(each)} tests of dives, {sum(test[0] for test in left):.0f} s of {sum(test[0] for test in each):.0f}")
    for most_s in SETS_S:
        words, took = {}, 0.0
        while left and took < most_s:
            seconds, program, name = left.pop(0)
            words.setdefault(program, []).append(name)
            took += seconds
        for program, names in words.items():
            result.append((program, ["--exact", *names], took))
    return result


def judge(mutant, programs, own_s, dives):
    """Result of a mutant, and the test that decided it."""
    package = mutant["package"]
    failed = run(programs[package], [], mutant["id"], own_s[package] * PATIENCE + PATIENCE_S)
    if failed is None:
        return "runs for ever", ""
    if failed:
        return "caught by its crate", failed
    for program, words, seconds in dives:
        failed = run(programs[program], words, mutant["id"], seconds * PATIENCE + PATIENCE_S)
        if failed is None:
            return "runs for ever", ""
        if failed:
            return "caught by dives", failed
    return "LIVES", ""


def all_judged(mutants, judge_one, end):
    """Results of as many mutants as time allows, by mutant number. AT_A_TIME mutants run in parallel."""
    waiting, results, printing = queue.SimpleQueue(), {}, threading.Lock()
    for mutant in mutants:
        waiting.put(mutant)

    def work():
        while time.monotonic() < end:
            try:
                mutant = waiting.get_nowait()
            except queue.Empty:
                return
            result, test = judge_one(mutant)
            with printing:
                results[mutant["id"]] = result
                print(f"{result:20} {mutant['name']}" + (f"    [{test}]" if test else ""), flush=True)

    workers = [threading.Thread(target=work) for _ in range(AT_A_TIME)]
    for worker in workers:
        worker.start()
    for worker in workers:
        worker.join()
    return results


def main(count, seed, minutes, part):
    begun = time.monotonic()
    chosen, of_all = drawn(count, seed, part)
    mutants = switched(chosen)
    programs = built()
    own_s = {f"headrace_{crate}": sum(timed(programs[f"headrace_{crate}"]).values()) for crate in CRATES}
    dives = sets(times_of({name: programs[name] for name in DIVES}))
    print(f"built and timed after {time.monotonic() - begun:.0f} s: own tests {own_s}", flush=True)
    results = all_judged(mutants, lambda mutant: judge(mutant, programs, own_s, dives), begun + 60 * minutes)
    counts = {result: list(results.values()).count(result) for result in sorted(set(results.values()))}
    print(f"{len(results)} of {of_all} mutants, drawn by seed {seed}: {counts}")


main(int(sys.argv[1]), int(sys.argv[2]), float(sys.argv[3]), sys.argv[4] if len(sys.argv) > 4 else "")
