# D of sections from true wall samples, by Voronoi vertices and edges of scipy: python3 tests/oracles/holes.py
#
# Reads tests/oracles/holes_truth.csv: chainage and arc length of samples, m. The first line has the wall's perimeter.
# Prints the table stored as tests/oracles/holes.csv: start, end and D of each section, m.
# D of a section is twice the largest distance to the nearest sample, over all centres in the section. Arc length is
# cyclic. The maximum lies at a vertex of the Voronoi diagram, or where one of its edges crosses an end of the section.
# With --trim TRUTH.csv PERIMETER, it prints the samples of a file written by `headrace simulate --truth` instead.
# Needs numpy and scipy.

import csv
import sys
from pathlib import Path

HERE = Path(__file__).parent
SECTION = 0.25


def trim(name, perimeter):
    """The wall samples of a truth file."""
    print(f"# perimeter_m = {perimeter}")
    print("x_m,arc_m")
    with open(name) as file:
        for row in csv.DictReader(line for line in file if not line.startswith("#")):
            if row["sense"] == "profiling_head" and row["arc_m"] and row["measured_range_m"]:
                print(row["wall_x_m"], row["arc_m"], sep=",")


def places():
    with open(HERE / "holes_truth.csv") as file:
        perimeter = float(file.readline().split("=")[1])
        file.readline()
        return [tuple(map(float, line.split(","))) for line in file], perimeter


def sections(found):
    """Starts and ends of the sections with samples on both sides, well away from the ends of the dive."""
    xs = [x for x, _ in found]
    first, last = int((min(xs) + 1) / SECTION) + 1, int((max(xs) - 1) / SECTION)
    return [(k * SECTION, (k + 1) * SECTION) for k in range(first, last)]


def main():
    import numpy
    from scipy.spatial import Voronoi, cKDTree

    found, perimeter = places()
    here = numpy.array(sorted(set(found)))
    images = numpy.concatenate([here + [0, turn * perimeter] for turn in (-1, 0, 1)])
    diagram, tree = Voronoi(images), cKDTree(images)
    print("from_m,to_m,hole_m")
    for begin, end in sections(found):
        centres = [v for v in diagram.vertices if begin <= v[0] < end and 0 <= v[1] < perimeter]
        for one, other in diagram.ridge_vertices:
            if one < 0:
                continue
            a, b = diagram.vertices[one], diagram.vertices[other]
            for x in (begin, end):
                if (a[0] - x) * (b[0] - x) < 0:
                    share = (x - a[0]) / (b[0] - a[0])
                    arc = a[1] + share * (b[1] - a[1])
                    if 0 <= arc < perimeter:
                        centres.append((x, arc))
        distances, _ = tree.query(numpy.array(centres))
        print(f"{begin!r},{end!r},{float(2 * distances.max())!r}")


if __name__ == "__main__":
    if sys.argv[1:2] == ["--trim"]:
        trim(sys.argv[2], sys.argv[3])
    else:
        main()
