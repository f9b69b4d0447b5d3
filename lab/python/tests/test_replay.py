"""Replays, compared with the program's reports, and tables in three libraries."""

import json
import re
import subprocess
import sys
import threading
import time

import pandas
import polars
import pyarrow
import pytest

import headrace

TABLES = ["dives", "sections", "holes", "flags", "runs", "sources", "alerts"]
#: Columns of sections, with their keys in reports.
COLUMNS = {
    "chainage_m": ["start_m"],
    "end_m": ["end_m"],
    "verdict": ["verdict"],
    "cannot_say": ["cannot_say"],
    "cause": ["cause", "cause"],
    "not_inspected": ["not_inspected"],
    "d_m": ["hole_m"],
    "d_least_m": ["hole_least_m"],
    "d_most_m": ["hole_most_m"],
    "t_x_mean_m": ["t_x", "mean_m"],
    "t_x_most_m": ["t_x", "max_m"],
    "t_y_mean_m": ["t_y", "mean_m"],
    "t_y_most_m": ["t_y", "max_m"],
    "t_most_m": ["t", "max_m"],
    "samples": ["samples"],
    "density_perm2": ["density_perm2"],
    "doubtful_returns": ["doubtful_returns"],
    "suspect": ["suspect"],
    "masked_share": ["masked_share"],
    "deviation_mean_m": ["deviation", "mean_m"],
    "contradicts": ["deviation", "contradicts"],
    "flagged_s": ["flagged_s"],
    "cleared_s": ["cleared_s"],
}


def rows(table):
    return pyarrow.table(table).to_pylist()


def report(program, tmp_path, *words):
    file = tmp_path / "report.json"
    finished = subprocess.run([program, "-q", "replay", *words, "--force", "--report", file], capture_output=True)
    assert file.is_file(), finished.stderr
    return json.loads(file.read_text()), finished.returncode


def at(value, path):
    for key in path:
        value = None if value is None else value[key]
    return value


def same_sections(tables, theirs):
    ours = rows(tables.sections)
    assert len(ours) == len(theirs["sections"]) > 0
    for mine, section in zip(ours, theirs["sections"]):
        for column, path in COLUMNS.items():
            assert mine[column] == at(section, path), (column, section["start_m"])
        if section["hole_m"] is not None:
            assert (mine["d_sd_m"], mine["d_bounded"]) == (section["hole_sd_m"], section["hole_bounded"])


@pytest.mark.parametrize("name", ["too-fast", "steel", "murk", "adrift", "autopilot", "sectors", "slipping-cable"])
def test_sections_match_the_golden_report(golden, name):
    tables = headrace.replay(golden / f"{name}.mcap")
    same_sections(tables, json.loads((golden / f"{name}.json").read_text()))


@pytest.mark.parametrize(
    "parameters, words",
    [
        ({}, []),
        ({"target_m": 0.3}, ["--target", "0.3"]),
        ({"section_m": 0.5, "sound_speed_mps": 1470.0}, ["--section", "0.5", "--sound-speed", "1470"]),
        ({"smooth": True}, ["--smooth"]),
    ],
)
def test_replay_equals_that_of_the_program(program, golden, tmp_path, parameters, words):
    log = golden / "too-fast.mcap"
    theirs, code = report(program, tmp_path, log, *words)
    tables = headrace.replay(str(log), **parameters)
    same_sections(tables, theirs)
    [dive] = rows(tables.dives)
    assert (dive["digest"], dive["exit_code"], dive["losses"]) == (theirs["digest"], code, 0)
    assert (dive["target_m"], dive["section_m"]) == (theirs["target_m"], theirs["section_m"])
    assert [(run["chainage_m"], run["end_m"], run["cause"]) for run in rows(tables.runs)] == [
        (run["start_m"], run["end_m"], run["cause"]) for run in theirs["runs"]
    ]
    assert [row["source"] for row in rows(tables.sources)] == [source["id"] for source in theirs["sources"]]
    assert len(tables.alerts) == len(theirs["alert_list"])
    flagged = [section for section in theirs["sections"] if section["flagged_s"] is not None]
    assert len(tables.flags) == len(flagged)


def test_another_vehicle_file_and_recordings_in_parts_are_replayed(program, golden, tmp_path):
    log = headrace.Log(golden / "too-fast.mcap")
    vehicle = tmp_path / "vehicle.toml"
    vehicle.write_text(re.sub(r"(?m)^target_m = .*$", "target_m = 0.4", log.vehicle_toml))
    for name, content in log.attachments.items():
        (tmp_path / name).write_bytes(content)
    theirs, _ = report(program, tmp_path, golden / "too-fast.mcap", "--vehicle", vehicle)
    assert theirs["target_m"] == 0.4
    same_sections(headrace.replay(log.files, vehicle=vehicle), theirs)

    # A recording in parts is one dive, whether given by its files or by its name.
    command = [program, "-q", "run", vehicle, "--source", golden / "too-fast.mcap", "--rotate", "20s", "--speed", "max"]
    subprocess.run([*command, "--record", tmp_path / "dive.mcap"], check=True)
    parts = sorted(tmp_path.glob("dive*.mcap"))
    assert len(parts) > 1
    for named in (parts, tmp_path / "dive.mcap"):
        same_sections(headrace.replay(named), theirs)
        assert headrace.Log(named).losses() == []
    [dive] = rows(headrace.replay(parts[:1]).dives)
    assert dive["losses"] == 1 and "part 2" in dive["lost"] and dive["exit_code"] == 3


def test_loss_appears_in_the_tables(program, golden, tmp_path):
    cut = tmp_path / "cut.mcap"
    whole = (golden / "too-fast.mcap").read_bytes()
    cut.write_bytes(whole[: len(whole) // 2])
    theirs, code = report(program, tmp_path, cut)
    tables = headrace.replay(cut)
    same_sections(tables, theirs)
    [dive] = rows(tables.dives)
    assert code == dive["exit_code"] == 3
    assert dive["lost"].splitlines() == theirs["log"]["losses"] and dive["losses"] == len(theirs["log"]["losses"]) > 0
    assert [loss.what for loss in headrace.Log(cut).losses()] == theirs["log"]["losses"]


@pytest.mark.parametrize("name", TABLES)
def test_pandas_polars_and_pyarrow_accept_every_table(golden, name):
    table = getattr(headrace.replay(golden / "steel.mcap"), name)
    arrow = pyarrow.table(table)
    assert arrow.num_rows == len(table) and arrow.column_names == table.column_names
    assert pyarrow.schema(table) == arrow.schema
    frame = polars.DataFrame(table)
    assert frame.shape == arrow.shape and frame.columns == table.column_names
    assert frame.rows() == polars.from_arrow(arrow).rows()
    # Before version 3, pandas converts a table through pyarrow.
    of_pandas = pandas.DataFrame.from_arrow(table) if hasattr(pandas.DataFrame, "from_arrow") else arrow.to_pandas()
    assert list(of_pandas.columns) == table.column_names
    # An unused capsule is released. A table gives any number of capsules.
    table.__arrow_c_stream__()
    assert pyarrow.table(table) == arrow
    assert f"{len(table)} rows" in repr(table)


def test_errors_state_the_file_and_the_location(golden, tmp_path):
    with pytest.raises(headrace.LogError) as caught:
        headrace.replay(tmp_path / "none.mcap")
    assert caught.value.file == str(tmp_path / "none.mcap")
    with pytest.raises(ValueError, match="target_m = 99: must be from 0.01 to 20"):
        headrace.replay(golden / "steel.mcap", target_m=99)
    with pytest.raises(ValueError, match="no log was named"):
        headrace.replay([])
    wrong = tmp_path / "wrong.toml"
    wrong.write_text("target_m = 0.5\nname = 3\n")
    with pytest.raises(headrace.ConfigError) as caught:
        headrace.replay(golden / "steel.mcap", vehicle=wrong)
    assert caught.value.file == str(wrong) and caught.value.place.startswith("line ")
    assert isinstance(caught.value, headrace.HeadraceError)
    direct = tmp_path / "direct.toml"
    direct.write_text((golden / "two-heads.toml").read_text() + '\n[navigation]\nway = "direct"\n')
    with pytest.raises(headrace.ReplayError, match="smooth needs") as caught:
        headrace.replay(golden / "too-fast.mcap", vehicle=direct, smooth=True)
    assert caught.value.file == str(golden / "too-fast.mcap")


def test_other_threads_run_while_a_dive_is_replayed(golden):
    counted = []
    done = threading.Event()

    def count():
        while not done.is_set():
            counted.append(None)
            time.sleep(0.001)

    thread = threading.Thread(target=count)
    thread.start()
    before = len(counted)
    headrace.replay(golden / "too-fast.mcap")
    meanwhile = len(counted) - before
    done.set()
    thread.join()
    assert meanwhile > 3


def test_an_interrupt_ends_a_replay(golden):
    # Compares processor time, which does not depend on the load of the machine: an interrupted replay takes less than half the time.
    text = (
        "import os, resource, signal, sys, threading, headrace\n"
        "cpu_s = lambda: resource.getrusage(resource.RUSAGE_SELF).ru_utime\n"
        "replay = lambda: headrace.replay(sys.argv[1], target_m=0.05, section_m=0.05, smooth=True)\n"
        "begun_s = cpu_s()\n"
        "replay()\n"
        "whole_s = cpu_s() - begun_s\n"
        "threading.Timer(0.05, os.kill, (os.getpid(), signal.SIGINT)).start()\n"
        "begun_s = cpu_s()\n"
        "try:\n    replay()\n"
        "except KeyboardInterrupt:\n    print('interrupted', cpu_s() - begun_s < whole_s / 2)\n"
        "    print(f'{whole_s:.2f} s whole, {cpu_s() - begun_s:.2f} s interrupted', file=sys.stderr)\n"
    )
    command = [sys.executable, "-c", text, golden / "too-fast.mcap"]
    finished = subprocess.run(command, capture_output=True, text=True)
    assert finished.stdout == "interrupted True\n", finished.stderr
