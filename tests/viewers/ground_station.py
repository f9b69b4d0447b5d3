#!/usr/bin/env python3
"""Receives a dive as QGroundControl would, with Python's `pymavlink`, and checks the messages.

    ground_station.py HEADRACE LOG.mcap      replays the log with --mavlink-out

Prints "skipped" and exits with 0 if the package isn't installed.
"""

import math
import subprocess
import sys
from collections import Counter

try:
    from pymavlink import mavutil
except ImportError as error:
    print(f"skipped: Python's package pymavlink is not there ({error})")
    sys.exit(0)

# Names that QGroundControl interprets as the autopilot's.
RESERVED = {"TetherTrn", "RFTarget", "CamTilt", "Lights1", "Lights2", "PilotGain", "InputHold", "RollPitch"}
# Messages that a ground station would interpret as the autopilot's.
NEVER = {"DISTANCE_SENSOR", "OBSTACLE_DISTANCE"}


def main():
    program, log = sys.argv[1:]
    station = mavutil.mavlink_connection("udpin:127.0.0.1:0", source_system=255)
    port = station.port.getsockname()[1]
    to = f"127.0.0.1:{port}"
    dive = subprocess.Popen(
        [program, "replay", log, "--speed", "40x", "--mavlink-out", to], stdout=subprocess.DEVNULL
    )
    kinds, names, faults, texts, parts = Counter(), {}, [], Counter(), {}
    while True:
        message = station.recv_match(blocking=True, timeout=1)
        if message is None:
            if dive.poll() is not None:
                break
            continue
        kind = message.get_type()
        kinds[kind] += 1
        if (message.get_srcSystem(), message.get_srcComponent()) != (1, 191):
            faults.append(f"{kind} from {message.get_srcSystem()}/{message.get_srcComponent()}")
        if kind == "HEARTBEAT" and (message.type, message.autopilot) != (18, 8):
            faults.append(f"heartbeat of type {message.type}, autopilot {message.autopilot}")
        if kind == "NAMED_VALUE_FLOAT":
            names.setdefault(message.name, []).append(message.value)
        if kind == "STATUSTEXT":
            parts[message.id] = parts.get(message.id, "") + message.text
            if message.id == 0 or len(message.text) < 50:
                texts[parts.pop(message.id)] += 1
    faults += [f"reserved name {name}" for name in RESERVED & set(names)]
    faults += [f"{kind} was sent" for kind in NEVER & set(kinds)]
    faults += [f"never heard {kind}" for kind in ("HEARTBEAT", "NAMED_VALUE_FLOAT", "STATUSTEXT") if not kinds[kind]]
    faults += [f"said {count} times: {text}" for text, count in texts.items() if count > 1]
    faults += [f"not complete: {text}" for text in parts.values()]
    if kinds["BAD_DATA"]:
        faults.append(f"{kinds['BAD_DATA']} broken frames")
    for name, values in sorted(names.items()):
        known = [value for value in values if not math.isnan(value)]
        span = f"{min(known):.3f} to {max(known):.3f}" if known else "never known"
        print(f"{len(values):6} {name:10} {span}")
    for text in texts:
        print(f"       {text}")
    for fault in faults:
        print(fault)
    print(f"{dict(kinds)}: {'DIFFERS' if faults else 'as it should be'}")
    sys.exit(1 if faults else 0)


main()
