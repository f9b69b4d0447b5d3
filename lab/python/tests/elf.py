"""Checks that a wheel's library is for aarch64 and depends only on the C library and Python: elf.py WHEEL"""

import struct
import sys
import zipfile

AARCH64 = 183

with zipfile.ZipFile(sys.argv[1]) as wheel:
    [name] = [name for name in wheel.namelist() if name.endswith(".so")]
    library = wheel.read(name)
assert sys.argv[1].endswith("aarch64.whl"), sys.argv[1]
assert library[:5] == b"\x7fELF\x02", "no 64-bit ELF file"
kind, machine = struct.unpack_from("<HH", library, 16)
assert (kind, machine) == (3, AARCH64), f"type {kind} of machine {machine}; a shared library (3) of {AARCH64} is wanted"
# Sections, from the ELF header. The dynamic section has type 6; its entries with tag 1 are the required libraries.
table, _, _, _, _, size, count, _ = struct.unpack_from("<QIHHHHHH", library, 40)
sections = [struct.unpack_from("<IIQQQQIIQQ", library, table + number * size) for number in range(count)]
[dynamic] = [section for section in sections if section[1] == 6]
strings = sections[dynamic[6]]
entries = [struct.unpack_from("<QQ", library, at) for at in range(dynamic[4], dynamic[4] + dynamic[5], 16)]
names = [library[strings[4] + value :].split(b"\0", 1)[0].decode() for tag, value in entries if tag == 1]
known = {"libc.so.6", "libm.so.6", "libgcc_s.so.1", "ld-linux-aarch64.so.1", "libpthread.so.0", "libdl.so.2"}
assert set(names) <= known, names
print(f"{name}: aarch64, needs {', '.join(names)}")
