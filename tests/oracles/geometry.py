# Reference values for hard rays in cross-sections, at 50 digits: python3 tests/oracles/geometry.py > tests/oracles/geometry.csv
#
# case, shape, dimensions (3, m), origin y and z, direction y and z, ray parameter at the wall, arc length there (m)
#
# Shapes by their definition (y left, z up, arc length from the floor's centre counter-clockwise with y to the right): rectangle
# (width, height), circle (radius), arch (width, height, radius of the vault), trimmed_circle (radius, base). The ray is
# intersected with every line and circle by the plain formula, and the nearest intersection ahead is used. Needs mpmath.
# Inputs are doubles and count as exact; values are rounded to 25 digits.

from math import inf, nextafter

from mpmath import asin, atan2, cos, hypot, mp, mpf, nstr, pi, radians, sin, sqrt

mp.dps = 50

SHAPES = [
    ("rectangle", 4.0, 3.0, 0.0),
    ("circle", 1.2, 0.0, 0.0),
    ("arch", 6.0, 5.0, 3.0),
    ("arch", 6.0, 5.0, 8.0),
    ("arch", 2.2, 2.3, 1.1),
    ("trimmed_circle", 6.05, 10.4, 0.0),
]


def pieces(shape, a, b, c):
    """Lines ("line", from, to) and arcs ("arc", centre, radius, from angle, sweep)."""
    a, b, c = mpf(a), mpf(b), mpf(c)
    if shape == "circle":
        return [("arc", (mpf(0), a), a, -pi / 2, 2 * pi)]
    half = (b if shape == "trimmed_circle" else a) / 2
    if shape == "trimmed_circle":
        height = sqrt(a * a - half * half)
        begin = -asin(height / a)
        arc = ("arc", (mpf(0), height), a, begin, pi - 2 * begin)
        return [("line", (mpf(0), mpf(0)), (half, mpf(0))), arc, ("line", (-half, mpf(0)), (mpf(0), mpf(0)))]
    if shape == "rectangle":
        corners = [(mpf(0), mpf(0)), (half, mpf(0)), (half, b), (-half, b), (-half, mpf(0)), (mpf(0), mpf(0))]
        return [("line", *ends) for ends in zip(corners, corners[1:])]
    spring = b - c + sqrt(c * c - half * half)
    sweep = 2 * asin(half / c)
    return [
        ("line", (mpf(0), mpf(0)), (half, mpf(0))),
        ("line", (half, mpf(0)), (half, spring)),
        ("arc", (mpf(0), b - c), c, pi / 2 - sweep / 2, sweep),
        ("line", (-half, spring), (-half, mpf(0))),
        ("line", (-half, mpf(0)), (mpf(0), mpf(0))),
    ]


def cross(a, b):
    return a[0] * b[1] - a[1] * b[0]


def leaves(shape, origin, direction):
    """Ray parameter and arc length of the ray's first intersection with the wall from inside."""
    y, z, v, w = map(mpf, (*origin, *direction))
    best, before, slack = None, mpf(0), mpf(10) ** -40
    for piece in pieces(*shape):
        meets = []
        if piece[0] == "line":
            (ay, az), (by, bz) = piece[1:]
            along = (by - ay, bz - az)
            length = hypot(*along)
            det = cross((v, w), along)
            if det != 0:
                t = cross((ay - y, az - z), along) / det
                share = cross((ay - y, az - z), (v, w)) / det
                if -slack <= share <= 1 + slack:
                    meets.append((t, share * length))
        else:
            (cy, cz), radius, begin, sweep = piece[1:]
            length = radius * sweep
            oy, oz = y - cy, z - cz
            qa, qb, qc = v * v + w * w, v * oy + w * oz, oy * oy + oz * oz - radius * radius
            disc = qb * qb - qa * qc
            if disc >= 0:
                for root in (sqrt(disc), -sqrt(disc)):
                    t = (root - qb) / qa
                    angle = (atan2(oz + t * w, oy + t * v) - begin) % (2 * pi)
                    if angle > 2 * pi - slack:
                        angle = mpf(0)
                    if angle <= sweep + slack:
                        meets.append((t, radius * angle))
        for t, along_m in meets:
            if t > mpf(10) ** -25 and (best is None or t < best[0]):
                best = (t, before + along_m)
        before += length
    assert best is not None, (shape, origin, direction)
    return best


def walls(shape, count):
    """Places on the wall with their inward normals, as doubles."""
    name, a, b, c = shape
    middle = {"circle": a, "trimmed_circle": sqrt(mpf(a) ** 2 - mpf(b) ** 2 / 4)}.get(name, mpf(b) / 2)
    for k in range(count):
        angle = 2 * pi * (k + mpf("0.313")) / count
        ray = (cos(angle), sin(angle))
        t, arc = leaves(shape, (mpf(0), middle), ray)
        place = (t * ray[0], middle + t * ray[1])
        before = mpf(0)
        for piece in pieces(*shape):
            if piece[0] == "line":
                (ay, az), (by, bz) = piece[1:]
                length = hypot(by - ay, bz - az)
                normal = (-(bz - az) / length, (by - ay) / length)
            else:
                length = piece[2] * piece[4]
                normal = tuple((centre - at) / piece[2] for centre, at in zip(piece[1], place))
            if before <= arc <= before + length:
                break
            before += length
        yield place, normal


def tell(case, shape, origin, direction):
    origin, direction = [tuple(map(float, pair)) for pair in (origin, direction)]
    t, arc = leaves(shape, origin, direction)
    print(case, *shape, *origin, *direction, nstr(t, 25), nstr(arc, 25), sep=",")


print("# Made by tests/oracles/geometry.py, which says what the columns are.")
for shape in SHAPES:
    for place, normal in walls(shape, 12):
        off = tuple(p + n * mpf("0.001") for p, n in zip(place, normal))
        for degrees in ("0", "45", "89.99", "-89.99"):
            turn = radians(mpf(degrees))
            out = (-normal[0], -normal[1])
            ray = (out[0] * cos(turn) - out[1] * sin(turn), out[0] * sin(turn) + out[1] * cos(turn))
            tell("grazing" if "89" in degrees else "millimetre", shape, off, ray)

# Rays through a corner, and rays whose first direction component is larger or smaller by an ulp.
for corner in ((2.0, 0.0), (2.0, 3.0), (-2.0, 3.0), (-2.0, 0.0)):
    for origin in ((0.0, 1.5), (0.25, 1.0), (-1.75, 2.875)):
        ray = tuple(c - o for c, o in zip(corner, origin))
        for first in (ray[0], nextafter(ray[0], inf), nextafter(ray[0], -inf)):
            tell("corner", SHAPES[0], origin, (first, ray[1]))

# Rays up along a wall that merges into the vault without a corner. The discriminant is 0, or slightly above. Half the
# width is exact.
for shape in (("arch", 6.0, 5.0, 3.0), ("arch", 2.2, 2.3, 1.1)):
    half = shape[1] / 2
    for ulps in (0, 1, 2, 7, 100, 10**6, 10**9):
        y = half
        y -= ulps * (half - nextafter(half, 0.0))
        for side in (1, -1):
            for z in (0.5, 1.0):
                tell("tangent", shape, (side * y, z), (0.0, 1.0))
