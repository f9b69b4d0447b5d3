#!/usr/bin/env python3
"""Trims recordings made by others to the fixtures in this folder: python3 tests/recordings/make.py FOLDER

FOLDER has the recordings at full length with their licences, each in a folder with the same name as here. Its README
states their sources. The Ping360 frames are made up by this script.
"""

import gzip
import pathlib
import shutil
import struct
import sys

HERE = pathlib.Path(__file__).resolve().parent


def bluerov2(full):
    """Keep the first 40 s as unchanged whole messages, and all camera messages with unknown definitions."""
    log = (full / "small.tlog").read_bytes()
    first_us, end = struct.unpack_from(">Q", log)[0], 0
    while struct.unpack_from(">Q", log, end)[0] - first_us < 40_000_000:
        # A time, then a MAVLink 1 or 2 frame, the latter possibly signed.
        version, payload, flags = log[end + 8 : end + 11]
        end += 8 + payload + (8 if version == 0xFE else 12 + 13 * (flags & 1))
    return {"small.tlog": log[:end]}


def imagenex852(full):
    """Keep the first shots unchanged, 640 bytes each."""
    shots = {"19_26_51-2016_11_18-sonar.852": 300, "hydroball.852": 50}
    return {name: (full / name).read_bytes()[: 640 * count] for name, count in shots.items()}


def broad(full):
    """Keep the first 105 s (35.5 s of them at rest) and the columns that the test uses; numbers are unchanged."""
    name = "derived_12_undisturbed_slow_translation_C_95Hz.csv.gz"
    rows = [line.split(",") for line in gzip.decompress((full / name).read_bytes()).decode().splitlines()]
    columns = [rows[0].index(column) for column in "gx gy gz ax ay az qw qx qy qz movement".split()]
    text = "".join(",".join(row[column] for column in columns) + "\n" for row in rows[: 1 + 10_000])
    return {name: gzip.compress(text.encode(), 9, mtime=0)}


def ping360():
    """Make frames of message 2300 (device 2, 14 bytes of settings, 1200 strengths) as a rotating Ping360 sends them."""
    frames = b""
    for number in range(20):
        settings = struct.pack("<BBHHHHHH", 1, 1, number * 20, 20, 888, 740, 1200, 1200)
        # An echo near the transducer, a far one, noise, and bytes that could begin a frame.
        echo = bytearray((number * 37 + at * at * 11) % 23 for at in range(1200))
        echo[:60] = bytes(255 - 4 * at for at in range(60))
        echo[500 + number : 520 + number] = bytes(range(100, 200, 5))
        echo[900 + number : 908 + number] = b"BR\x04\x00\x05\x00\x01\x00"
        payload = settings + echo
        frame = b"BR" + struct.pack("<HHBB", len(payload), 2300, 2, 0) + payload
        frames += frame + struct.pack("<H", sum(frame) & 0xFFFF)
    return {"frames.bin": frames}


def main():
    full = pathlib.Path(sys.argv[1])
    trimmed = {
        "bluerov2_ardusub_logs": bluerov2,
        "imagenex852_cidco": imagenex852,
        "imu_broad": broad,
    }
    made = {name: make(full / name) for name, make in trimmed.items()}
    for name, files in (made | {"ping360_made_up": ping360()}).items():
        folder = HERE / name
        folder.mkdir(exist_ok=True)
        for file, content in files.items():
            (folder / file).write_bytes(content)
            print(f"{len(content):8} {name}/{file}")
        if name in trimmed:
            shutil.copyfile(full / name / "LICENSE", folder / "LICENSE")


main()
