#!/usr/bin/env python3
"""Content of a MAVLink telemetry log, for tests/tests/import/recordings.rs: python3 tests/oracles/tlog.py FILE

Written from MAVLink's definitions, without code of headrace. Prints the number of frames, and counts and ranges of the
autopilot's ATTITUDE, RAW_IMU, SCALED_PRESSURE and SCALED_PRESSURE2 messages, in the messages' own units and signs.
"""

import collections
import math
import struct
import sys

# Message number, extra byte of the checksum, layout on the wire.
MESSAGES = {
    "ATTITUDE": (30, 39, "<Iffffff"),
    "RAW_IMU": (27, 144, "<Qhhhhhhhhh"),
    "SCALED_PRESSURE": (29, 115, "<Iffh"),
    "SCALED_PRESSURE2": (137, 195, "<Iffh"),
}


def checksum(content, crc=0xFFFF):
    """CRC-16/MCRF4XX, bit by bit; `crc` continues an earlier checksum."""
    for byte in content:
        crc ^= byte
        for _ in range(8):
            crc = crc >> 1 ^ (0x8408 if crc & 1 else 0)
    return crc


def frames(log):
    """For each frame: system, component, message, payload, bytes under the checksum, and the checksum."""
    at = 0
    while at < len(log):
        at += 8
        long = log[at] == 0xFD
        assert long or log[at] == 0xFE, f"no frame at {at}"
        size, start = log[at + 1], at + (10 if long else 6)
        system, component = log[at + 5 : at + 7] if long else log[at + 3 : at + 5]
        number = int.from_bytes(log[at + 7 : at + 10], "little") if long else log[at + 5]
        end = start + size
        yield system, component, number, log[start:end], log[at + 1 : end], int.from_bytes(log[end : end + 2], "little")
        at = end + 2 + (13 if long and log[at + 2] & 1 else 0)


def main():
    with open(sys.argv[1], "rb") as file:
        found = list(frames(file.read()))
    print(f"frames {len(found)}")
    # If a message's definition is missing, one extra byte must match all frames with its number.
    fits = collections.defaultdict(list)
    for _, component, number, _, content, crc in found:
        before = checksum(content)
        fits[component, number].append([extra for extra in range(256) if checksum([extra], before) == crc])
    for (component, number), each in sorted(fits.items()):
        if [] in each or len({tuple(extras) for extras in each}) > 1:
            print(f"component {component}, message {number}: added bytes {each[:4]} of {len(each)}")
    for name, (number, extra, layout) in MESSAGES.items():
        mine = [frame for frame in found if frame[:3] == (1, 1, number)]
        assert all(checksum(content + bytes([extra])) == crc for *_, content, crc in mine), name
        size = struct.calcsize(layout)
        values = [struct.unpack_from(layout, payload.ljust(size, b"\0")) for _, _, _, payload, _, _ in mine]
        print(f"{name} {len(values)}")
        if name == "ATTITUDE":
            for angle, column in zip(("roll", "pitch", "yaw"), zip(*(value[1:4] for value in values))):
                print(f"  {angle} {min(column):.6f} to {max(column):.6f} rad")
        elif name == "RAW_IMU":
            norms = [math.hypot(*value[1:4]) / 1000 for value in values]
            print(f"  force {min(norms):.4f} to {max(norms):.4f}, mean {sum(norms) / len(norms):.6f} g")
        else:
            pressures, degrees = [value[1] for value in values], [value[3] / 100 for value in values]
            print(f"  {min(pressures):.3f} to {max(pressures):.3f} hPa, {min(degrees)} to {max(degrees)} degC")


main()
