#!/usr/bin/env python3
"""Runs mutants drawn from those that cargo-mutants makes, in the copy of the sources that tests/mutants/run has made.

sample.py N SEED MINUTES: cargo-mutants lists and words the mutants; each is applied, its crate's own tests are run, and where
these pass the quick ones of tests/tests. No golden file, digest or snapshot of results is among them. Exit code 0.
"""
import json
import os
import random
import signal
import subprocess
import sys
import time

QUICK = ["--test", "coverage", "--test", "sampling", "--test", "navigation"]
SKIPPED = ["interventions::", "causes::", "field::", "faults::", "cable::", "settings::", "fusion::", "smoothing::"]
OWN_S, QUICK_S = 180, 420


def ended(command, seconds):
    """How a command ended: its exit code, or None where it took too long. What it has begun is then killed with it."""
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True) as begun:
        try:
            return begun.wait(seconds)
        except subprocess.TimeoutExpired:
            os.killpg(begun.pid, signal.SIGKILL)
            return None


def patched(diff, *options):
    return subprocess.run(["patch", "-s", "-p0", *options], input=diff.encode(), check=False).returncode == 0


def by_its_crate(mutant):
    """What the own tests of a mutant's crate say."""
    test = ["cargo", "test", "--quiet", "-p", mutant["package"], "--lib"]
    code = ended([*test, "--no-run"], 900)
    if code != 0:
        return "doesn't build"
    code = ended(test, OWN_S)
    return "runs for ever" if code is None else "caught by its crate" if code else "lives in its crate"


def by_dives(_):
    """What the quick tests of dives say."""
    skipped = [part for name in SKIPPED for part in ("--skip", name)]
    test = ["cargo", "test", "--quiet", "--no-fail-fast", "-p", "headrace_tests", *QUICK]
    ended([*test, "--no-run"], 900)
    code = ended([*test, "--", *skipped], QUICK_S)
    # A slow machine takes longer for any mutant: that catches none.
    return "not known: too slow" if code is None else "LIVES" if code == 0 else "caught by dives"


def each(mutants, judge, end):
    """The results by name, of as many as there is time for."""
    results = {}
    for mutant in mutants:
        if time.monotonic() > end:
            break
        if not patched(mutant["diff"]):
            sys.exit(f"{mutant['name']}: its patch doesn't apply")
        result = judge(mutant)
        patched(mutant["diff"], "-R")
        results[mutant["name"]] = result
        print(f"{result:20} {mutant['name']}", flush=True)
    return results


def main(count, seed, minutes):
    begun = time.monotonic()
    config = ["--workspace", "--config", "tests/mutants/mutants.toml"]
    listed = subprocess.run(["cargo", "mutants", *config, "--list", "--json", "--diff"], stdout=subprocess.PIPE, check=True)
    # Fields left to their defaults are mostly those that tests build from parts.
    mutants = [mutant for mutant in json.loads(listed.stdout) if "delete field" not in mutant["name"]]
    drawn = random.Random(seed).sample(mutants, min(count, len(mutants)))
    results = each(drawn, by_its_crate, begun + 30 * minutes)
    left = [mutant for mutant in drawn if results.get(mutant["name"]) == "lives in its crate"]
    results.update(each(left, by_dives, begun + 60 * minutes))
    counts = {result: list(results.values()).count(result) for result in sorted(set(results.values()))}
    print(f"{len(results)} of {len(mutants)} mutants, drawn by seed {seed}: {counts}")


main(int(sys.argv[1]), int(sys.argv[2]), float(sys.argv[3]))
