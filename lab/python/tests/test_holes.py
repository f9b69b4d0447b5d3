"""Holes of point clouds, compared with the Voronoi diagrams of scipy."""

import math

import numpy
import pytest
from scipy.spatial import Voronoi, cKDTree

import headrace

pyarrow = pytest.importorskip("pyarrow")


def found(*points, **options):
    return pyarrow.table(headrace.holes(*points, **options)).to_pandas()


def largest_empty_circles(x_m, arc_m, perimeter_m, sections):
    """D of each section: the largest distance to a point is at a vertex of the diagram, or where an edge leaves the section."""
    images = numpy.concatenate([numpy.column_stack([x_m, arc_m + turn * perimeter_m]) for turn in (-1, 0, 1)])
    diagram, tree = Voronoi(images), cKDTree(images)
    edges = numpy.array([edge for edge in diagram.ridge_vertices if edge[0] >= 0])
    ends = diagram.vertices[edges]
    for begin, end in sections:
        inside = (diagram.vertices[:, 0] >= begin) & (diagram.vertices[:, 0] <= end)
        centres = [diagram.vertices[inside]]
        for x in (begin, end):
            crosses = (ends[:, 0, 0] - x) * (ends[:, 1, 0] - x) < 0
            a, b = ends[crosses, 0], ends[crosses, 1]
            share = (x - a[:, 0]) / (b[:, 0] - a[:, 0])
            arcs = a[:, 1] + share * (b[:, 1] - a[:, 1])
            centres.append(numpy.column_stack([numpy.full(len(arcs), x), arcs]))
        centres = numpy.concatenate(centres)
        centres = centres[(centres[:, 1] >= 0) & (centres[:, 1] < perimeter_m)]
        yield 2 * tree.query(centres)[0].max()


@pytest.mark.parametrize("seed, count, section_m", [(1, 3000, 0.25), (2, 400, 0.5), (3, 12000, 1.0)])
def test_holes_match_the_voronoi_diagram(seed, count, section_m):
    random = numpy.random.default_rng(seed)
    perimeter_m, length_m = 11.3, 70.0
    x_m, arc_m = random.uniform(-length_m / 2, length_m / 2, count), random.uniform(0, perimeter_m, count)
    holes = found(x_m, arc_m, perimeter_m=perimeter_m, section_m=section_m, from_m=-28.0, to_m=28.0)
    assert len(holes) == 56 / section_m + 1
    sections = list(zip(holes.chainage_m, holes.end_m))
    assert sections[0] == (-28.0, -28.0 + section_m) and holes.d_bounded.all()
    expected = numpy.array(list(largest_empty_circles(x_m, arc_m, perimeter_m, sections)))
    assert numpy.abs(holes.d_m - expected).max() < 1e-8
    assert (holes.d_least_m <= expected + 1e-8).all() and (expected <= holes.d_most_m + 1e-8).all()
    # The centre of the hole is at the stated position.
    images = numpy.concatenate([numpy.column_stack([x_m, arc_m + turn * perimeter_m]) for turn in (-1, 0, 1)])
    radii = cKDTree(images).query(numpy.column_stack([holes.d_x_m, holes.d_arc_m]))[0]
    assert numpy.abs(2 * radii - holes.d_m).max() < 1e-8


def test_dense_cloud_is_within_its_bounds():
    random = numpy.random.default_rng(4)
    perimeter_m, count = 2.0, 20_000
    x_m, arc_m = random.uniform(0, 4.0, count), random.uniform(0, perimeter_m, count)
    holes = found(x_m, arc_m, perimeter_m=perimeter_m, from_m=1.0, to_m=2.9)
    sections = list(zip(holes.chainage_m, holes.end_m))
    expected = numpy.array(list(largest_empty_circles(x_m, arc_m, perimeter_m, sections)))
    assert (holes.d_least_m <= expected + 1e-8).all() and (expected <= holes.d_most_m + 1e-8).all()
    # Thinning has dropped some points that have close neighbours.
    assert (holes.d_least_m < holes.d_m).any() and (holes.d_m < 0.2).all()


def test_largest_hole_of_a_lattice_is_its_diagonal():
    x_m, arc_m = (grid.ravel() for grid in numpy.meshgrid(numpy.arange(20) * 0.5, numpy.arange(24) * 0.5))
    # Views with strides, integers and lists are accepted too.
    both = numpy.column_stack([x_m, arc_m])
    holes = found(both[:, 0], both[:, 1], perimeter_m=12.0, from_m=2, to_m=5)
    assert holes.d_m.to_numpy() == pytest.approx(math.hypot(0.5, 0.5))
    assert list(found([0, 1], [0, 0], perimeter_m=1.0).d_m)[1] == pytest.approx(
        2 * math.hypot(0.5, 0.5)
    )


def test_hole_in_a_wall_without_points_is_unbounded():
    holes = found([0.0], [0.0], perimeter_m=5.0, from_m=0.0, to_m=40.0)
    far = holes[holes.chainage_m > 13]
    assert not far.d_bounded.any() and far.d_most_m.isna().all() and (far.d_m == 24).all()
    assert holes.d_bounded.iloc[0]
    assert len(found([], [], perimeter_m=5.0, from_m=0.0, to_m=1.0)) == 5


def test_arguments_out_of_range_are_refused_by_name():
    with pytest.raises(ValueError, match="x_m has 1 values and arc_m has 2"):
        headrace.holes([1.0], [1.0, 2.0], perimeter_m=5.0)
    with pytest.raises(ValueError, match="point 1 has x_m NaN"):
        headrace.holes([1.0, math.nan], [1.0, 2.0], perimeter_m=5.0)
    for perimeter_m in (0.0, -1.0, math.inf, math.nan):
        with pytest.raises(ValueError, match="perimeter_m is"):
            headrace.holes([1.0], [1.0], perimeter_m=perimeter_m)
    with pytest.raises(ValueError, match="section_m is"):
        headrace.holes([1.0], [1.0], perimeter_m=5.0, section_m=0)
    with pytest.raises(ValueError, match="there are no points"):
        headrace.holes([], [], perimeter_m=5.0)
    with pytest.raises(ValueError, match="sections of"):
        headrace.holes([1.0], [1.0], perimeter_m=5.0, from_m=2.0, to_m=1.0)
    with pytest.raises(ValueError, match="sections of"):
        headrace.holes([0.0, 1e9], [1.0, 1.0], perimeter_m=5.0)
