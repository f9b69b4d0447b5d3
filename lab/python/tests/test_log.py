"""Logs: messages, sources, attachments and losses."""

import struct
import subprocess
import threading
from pathlib import Path

import pytest

import headrace

MAGIC = b"\x89MCAP0\r\n"


def records(path: Path):
    """Opcode and content of each record of an MCAP file, following the MCAP specification."""
    data = path.read_bytes()
    assert data.startswith(MAGIC) and data.endswith(MAGIC)
    at = len(MAGIC)
    while at < len(data) - len(MAGIC):
        opcode, length = struct.unpack_from("<BQ", data, at)
        yield at, opcode, data[at + 9 : at + 9 + length]
        at += 9 + length


def statistics(path: Path):
    """Number of messages, and first and last time, from the log's statistics record (opcode 0x0b)."""
    [content] = [content for _, opcode, content in records(path) if opcode == 0x0B]
    messages, _, _, _, _, _, first, last = struct.unpack_from("<QHIIIIQQ", content)
    return messages, first, last


def test_messages_and_times_match_the_statistics_in_the_log(golden):
    path = golden / "steel.mcap"
    log = headrace.Log(path)
    messages, first, last = statistics(path)
    read = list(log.messages())
    assert len(read) == messages > 1000
    assert (min(m.log_time_ns for m in read), max(m.log_time_ns for m in read)) == (first, last)
    assert log.span_ns == (first, last)
    assert (log.losses(), log.notes()) == ([], [])
    assert [Path(file) for file in log.files] == [path]


def test_sources_match_the_vehicle_file(golden):
    log = headrace.Log(str(golden / "steel.mcap"))
    ids = [source.id for source in log.sources()]
    assert len(set(ids)) == len(ids)
    for source in log.sources():
        if source.id != "console":
            assert f'id = "{source.id}"' in log.vehicle_toml and source.plugin in log.vehicle_toml
    some = ids[0]
    of_one = list(log.messages(some))
    of_all = [m for m in log.messages() if m.source == some]
    assert [(m.kind, m.sequence, m.data) for m in of_one] == [(m.kind, m.sequence, m.data) for m in of_all]
    assert {m.kind for m in of_one} <= {"raw", "sent"} and of_one


def test_recording_has_its_input_messages_ticks_and_results(program, golden, tmp_path):
    given = headrace.Log(golden / "steel.mcap")
    (tmp_path / "vehicle.toml").write_text(given.vehicle_toml)
    for name, content in given.attachments.items():
        (tmp_path / name).write_bytes(content)
    command = [program, "-q", "run", tmp_path / "vehicle.toml", "--source", golden / "steel.mcap", "--speed", "max"]
    subprocess.run([*command, "--record", tmp_path / "dive.mcap"], check=True)
    recorded = headrace.Log(tmp_path / "dive.mcap")
    assert recorded.has_ticks and not given.has_ticks
    assert {m.kind for m in recorded.messages()} >= {"raw", "tick", "result"}
    assert all(m.topic.startswith("/result/") for m in recorded.messages() if m.kind == "result")
    raw = [sorted((m.log_time_ns, m.source, m.data) for m in log.messages() if m.kind == "raw") for log in (given, recorded)]
    assert raw[0] == raw[1]
    assert recorded.vehicle_toml == given.vehicle_toml and recorded.losses() == []
    assert "version" in recorded.metadata


def test_damage_is_reported_with_its_location(golden, tmp_path):
    whole = (golden / "steel.mcap").read_bytes()
    at, _, content = [record for record in records(golden / "steel.mcap") if record[1] == 0x06][5]
    broken = bytearray(whole)
    broken[at + 9 + len(content) // 2] ^= 0xFF
    (tmp_path / "broken.mcap").write_bytes(broken)
    log = headrace.Log(tmp_path / "broken.mcap")
    kept = len(list(log.messages()))
    [loss] = log.losses()
    assert loss.offset == at and loss.bytes == 9 + len(content)
    assert f"byte {at}" in loss.what == str(loss) and loss.from_ns < loss.to_ns
    assert 0 < kept < len(list(headrace.Log(golden / "steel.mcap").messages()))

    (tmp_path / "cut.mcap").write_bytes(whole[: len(whole) // 2])
    assert any("ends before" in loss.what for loss in headrace.Log(tmp_path / "cut.mcap").losses())


def test_file_that_is_no_log_raises_an_error_with_file_and_location(golden, tmp_path):
    other = tmp_path / "other.mcap"
    other.write_bytes(b"no log at all")
    with pytest.raises(headrace.LogError, match="not an MCAP file") as caught:
        headrace.Log(other)
    assert (caught.value.file, caught.value.place) == (str(other), "byte 0")
    with pytest.raises(headrace.LogError, match="could not open") as caught:
        headrace.Log(tmp_path / "none.mcap")
    assert caught.value.file == str(tmp_path / "none.mcap")
    with pytest.raises(headrace.HeadraceError, match="no such source"):
        list(headrace.Log(golden / "steel.mcap").messages("none"))
    with pytest.raises(TypeError):
        headrace.Log(3)


def test_several_threads_read_one_log(golden):
    log = headrace.Log(golden / "steel.mcap")
    messages = log.messages()
    taken = [[], []]

    def take(mine):
        mine.extend((m.log_time_ns, m.source, m.sequence) for m in messages)

    threads = [threading.Thread(target=take, args=(mine,)) for mine in taken]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    everything = sorted((m.log_time_ns, str(m.source), m.sequence) for m in log.messages())
    assert sorted((at, str(source), number) for at, source, number in taken[0] + taken[1]) == everything


def test_profile_matches_the_attached_vehicle_file(golden):
    profile = headrace.Log(golden / "steel.mcap").profile()
    assert profile.contains(*profile.reference_m)
    assert 5 < profile.perimeter_m < 100
