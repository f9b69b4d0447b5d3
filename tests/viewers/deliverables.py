#!/usr/bin/env python3
"""Reads the files of a delivered folder with other programs' packages and compares them with each other.

    deliverables.py FOLDER               prints differences, and exits with 1 if there are any
    deliverables.py --self-test FOLDER   damages each file of a copy in one way, and checks that the damage is found

Needs laspy, lazrs, pye57, ezdxf, plyfile, tifffile, trimesh, pillow. Prints "skipped" and exits with 0 without them.
"""

import csv
import shutil
import struct
import sys
import tempfile
from pathlib import Path

try:
    import ezdxf
    import laspy
    import lazrs  # noqa: F401, laspy reads LAZ with it
    import numpy as np
    import plyfile
    import pye57
    import tifffile
    import trimesh
    from PIL import Image
except ImportError as error:
    print(f"skipped: a package that reads the files is not there ({error})")
    sys.exit(0)

# A map of 7 km is larger than Pillow's guard against bombs.
Image.MAX_IMAGE_PIXELS = None
VALUES = ["x", "y", "z", "range_m", "position_sd_m", "clock_h", "time_s", "head", "doubtful"]
NO_DATA = -9999.0


class Check:
    """Files of a folder, and the differences found in words."""

    def __init__(self, folder):
        self.folder = Path(folder)
        self.wrong = []
        for look in (self.points, self.tables, self.drawings, self.map, self.wall):
            try:
                look()
            except Exception as error:  # any error that a damaged file causes
                self.wrong.append(f"{look.__name__}: {error!r}")

    def path(self, name):
        return str(self.folder / name)

    def same(self, what, told, found, tolerance=1e-6):
        told, found = np.asarray(told, dtype=float), np.asarray(found, dtype=float)
        if told.shape != found.shape:
            self.wrong.append(f"{what}: {told.shape} values against {found.shape}")
        elif told.size and not np.allclose(told, found, rtol=0, atol=tolerance, equal_nan=True):
            worst = np.nanargmax(np.abs(told - found))
            self.wrong.append(f"{what}: {told.flat[worst]} against {found.flat[worst]} at {worst}")

    def points(self):
        """Values of all points in PLY against the other formats, and the bounds that headers state."""
        vertices = plyfile.PlyData.read(self.path("points.ply"))["vertex"]
        told = {name: np.array(vertices[name], dtype=float) for name in VALUES}
        self.count = len(vertices)
        for name in ["points.las", "points.laz"]:
            las = laspy.read(self.path(name))
            self.same(f"{name}, count", self.count, las.header.point_count)
            for value in VALUES:
                self.same(f"{name}, {value}", told[value], las["gps_time" if value == "time_s" else value])
            if self.count:
                self.same(f"{name}, bounds", las.header.mins, [told[axis].min() for axis in "xyz"])
                self.same(f"{name}, bounds", las.header.maxs, [told[axis].max() for axis in "xyz"])
        e57 = pye57.E57(self.path("points.e57"))
        self.same("points.e57, count", self.count, e57.get_header(0).point_count)
        if self.count:
            read = e57.read_scan_raw(0, ignore_unsupported_fields=True)
            for axis in "xyz":
                self.same(f"points.e57, {axis}", told[axis], read[f"cartesian{axis.upper()}"])
        with open(self.path("points.xyz"), encoding="utf-8") as file:
            lines = [line.split() for line in file if not line.startswith("#")]
        lines = np.array(lines, dtype=float).reshape(-1, len(VALUES))
        for column, value in enumerate(VALUES):
            self.same(f"points.xyz, {value}", told[value], lines[:, column])
        self.told = told

    def rows(self, name):
        with open(self.path(name), encoding="utf-8", newline="") as file:
            return list(csv.DictReader(file, strict=True))

    def tables(self):
        """Tables have all their cells, and the numbers are numbers."""
        for name in ["sections.csv", "outlines.csv", "profile.csv", "findings.csv", "track.csv"]:
            for number, row in enumerate(self.rows(name), 1):
                if None in row or None in row.values():
                    self.wrong.append(f"{name}, row {number}: cells are missing or too many")
                for column, cell in row.items():
                    if column and column.split("_")[-1] in ("m", "s", "h", "deg") and cell:
                        float(cell)
        times = [float(row["time_s"]) for row in self.rows("track.csv")]
        self.same("track.csv, times", times, sorted(times))

    def drawings(self):
        """Corners in the drawing of sections and in their table, and the audit of each drawing."""
        for name in ["sections.dxf", "sheet.dxf", "profile.dxf"]:
            audit = ezdxf.readfile(self.path(name)).audit()
            self.wrong.extend(f"{name}: {error.message}" for error in audit.errors + audit.fixes)
        told = [[float(row[key]) for key in ("chainage_m", "y_m", "z_m")] for row in self.rows("outlines.csv")]
        for name in ["sections.dxf", "sheet.dxf"]:
            drawn = ezdxf.readfile(self.path(name)).modelspace()
            self.same(f"{name}, labels", len(self.rows("sections.csv")), len(drawn.query("TEXT")))
            corners = list(places(drawn.query("POLYLINE POINT")))
            self.same(f"{name}, corners", len(told), len(corners))
            if name == "sections.dxf":
                self.same(f"{name}, corners", told, corners)
        lines = ezdxf.readfile(self.path("profile.dxf")).modelspace().query('POLYLINE POINT[layer=="MEASURED"]')
        drawn = sorted((x, y) for x, y, _ in places(lines))
        told = [
            (float(row["chainage_m"]), float(row[edge]))
            for row in self.rows("profile.csv")
            for edge in ("floor_z_m", "crown_z_m")
            if row[edge]
        ]
        self.same("profile.dxf, corners", sorted(told), drawn)

    def map(self):
        """Picture against data, world files against tags, and the map's extent against the points."""
        with tifffile.TiffFile(self.path("map.tif")) as file:
            tags = {tag.name: tag.value for tag in file.pages[0].tags}
            data = file.pages[0].asarray()
        width, height, _ = tags["ModelPixelScaleTag"]
        left, top = tags["ModelTiepointTag"][3:5]
        self.same("map.tif, no data", float(tags["GDAL_NODATA"]), NO_DATA)
        for name in ["map.pgw", "map.tfw"]:
            lines = [float(line) for line in (self.folder / name).read_text().split()]
            self.same(name, [width, 0, 0, -height, left + width / 2, top - height / 2], lines)
        picture = np.asarray(Image.open(self.path("map.png")))
        self.same("map.png, size", data.shape, picture.shape)
        self.same("map.png, pixels not measured", data == NO_DATA, picture == 0)
        measured = data != NO_DATA
        inwards, outwards = measured & (data < -0.01), measured & (data > 0.01)
        self.same("map.png, inwards", picture[inwards] <= 128, np.ones(inwards.sum()))
        self.same("map.png, outwards", picture[outwards] >= 128, np.ones(outwards.sum()))
        self.extent = left, left + width * data.shape[1]

    def wall(self):
        """Extent of the wall against that of the map. glTF's y is up, so that its x is the chainage."""
        scene = trimesh.load(self.path("wall.glb"), force="scene")
        if scene.geometry:
            least, most = scene.bounds
            for name, told, found in [("begin", self.extent[0], least[0]), ("end", self.extent[1], most[0])]:
                self.same(f"wall.glb, {name}", told, found, 1.0)
            z = self.told["z"][self.told["doubtful"] == 0]
            inside = (z > least[1] - 0.5) & (z < most[1] + 0.5)
            self.same("wall.glb, share of points at its height", 1.0, inside.mean() if z.size else 1.0, 0.01)


def places(drawn):
    """Corners of the polylines, and single points."""
    for entity in drawn:
        if entity.dxftype() == "POINT":
            yield tuple(entity.dxf.location)
        else:
            yield from (tuple(vertex.dxf.location) for vertex in entity.vertices)


def changed(path, find, layout, by, offset=0):
    """Adds `by` to the value `offset` bytes after the first occurrence of `find`."""
    data = bytearray(path.read_bytes())
    place = data.index(find) + len(find) + offset
    value = struct.unpack_from(layout, data, place)[0]
    struct.pack_into(layout, data, place, value + by)
    path.write_bytes(data)


def swapped(path, old, new):
    """Replaces all occurrences of `old`."""
    path.write_bytes(path.read_bytes().replace(old, new))


def las(path):
    """Moves the first point, which follows the header. Byte 96 has the header's length."""
    changed(path, b"LASF", "<i", 1, struct.unpack_from("<I", path.read_bytes(), 96)[0] - 4)


def replaced(path, number, column, text):
    """Replaces a cell of a table without quoted cells before it."""
    lines = path.read_bytes().split(b"\r\n")
    cells = lines[number].split(b",")
    cells[column] = text
    lines[number] = b",".join(cells)
    path.write_bytes(b"\r\n".join(lines))


def xyz(path):
    lines = path.read_text(encoding="utf-8").splitlines(keepends=True)
    lines[3] = lines[3].replace(lines[3].split()[3], "99.999", 1)
    path.write_text("".join(lines), encoding="utf-8")


def tiff(path):
    with tifffile.TiffFile(path) as file:
        data, tags = file.pages[0].asarray(), file.pages[0].tags
        keep = [(t.code, t.dtype, t.count, t.value, True) for t in tags if t.code in (33550, 33922, 42113)]
    data[0, 0] = NO_DATA if data[0, 0] != NO_DATA else 1.0
    tifffile.imwrite(path, data, extratags=keep)


# Damage of each file, and the words that must report it.
SPOILS = {
    "points.ply": ("points.las, x", lambda path: changed(path, b"end_header\n", "<d", 0.001)),
    "points.las": ("points.las, x", las),
    "points.laz": ("points.laz, bounds", lambda path: changed(path, b"LASF", "<d", 0.001, 179 - 4)),
    "points.e57": ("points: E57Exception", lambda path: changed(path, b"recordCount=\"", "<B", 1)),
    "points.xyz": ("points.xyz, range_m", xyz),
    "sections.csv": ("tables: ValueError", lambda path: replaced(path, 1, 1, b"x")),
    "outlines.csv": ("sections.dxf, corners", lambda path: replaced(path, 2, 4, b"0.123")),
    "profile.csv": ("profile.dxf, corners", lambda path: replaced(path, 1, 2, b"0.987")),
    "findings.csv": ("findings.csv, row 1", lambda path: replaced(path, 1, 2, b"1.0,2.0")),
    "track.csv": ("track.csv, times", lambda path: replaced(path, 1, 0, b"9999999.0")),
    "sections.dxf": ("sections.dxf, corners", lambda path: changed(path, b" 70\r\n32\r\n 10\r\n", "<B", 1)),
    "sheet.dxf": ("sheet.dxf", lambda path: swapped(path, b"\r\nTEXT\r\n", b"\r\nTXT\r\n")),
    "profile.dxf": ("profile.dxf, corners", lambda path: swapped(path, b"MEASURED\r\n 66", b"DESIGN\r\n 66")),
    "map.png": ("map.png", lambda path: Image.fromarray(np.asarray(Image.open(path)) ^ 1).save(path)),
    "map.tif": ("map.png, pixels", tiff),
    "map.tfw": ("map.tfw", lambda path: path.write_text(path.read_text().replace("0.", "1.", 1))),
    "wall.glb": ("wall", lambda path: changed(path, b'"translation":[', "<B", 2)),
}


def self_test(folder):
    failed = 0
    for name, (words, spoil) in SPOILS.items():
        with tempfile.TemporaryDirectory() as copy:
            shutil.copytree(folder, copy, dirs_exist_ok=True)
            spoil(Path(copy) / name)
            found = [line for line in Check(copy).wrong if line.startswith(words)]
        print(f"spoilt {name}: {'found ' + found[0][:100] if found else 'NOT FOUND ' + words}")
        failed += not found
    return failed


def main():
    arguments = sys.argv[1:]
    if arguments[0] == "--self-test":
        sys.exit(1 if self_test(arguments[-1]) else 0)
    check = Check(arguments[-1])
    for line in check.wrong:
        print(line)
    print(f"{getattr(check, 'count', '?')} points: {'DIFFERS' if check.wrong else 'all files agree'}")
    sys.exit(1 if check.wrong else 0)


main()
