# Reference values for the sampling theory, at 50 digits: python3 tests/oracles/sampling.py > tests/oracles/sampling.csv
#
# Source: Jorge et al., Sensors 2021, 21, 1900, equations as printed, on the definitions of frames and of the unrolled
# wall (x ahead, y left, z up; alpha 0 down, growing to the left; sigma from the floor's centre via the left wall).
# Needs mpmath. Angles are in radians, lengths in metres. Inputs are doubles and count as exact, so a value's only error
# is its rounding to 25 digits, or 1e-45 near 0. Plain formulas suffice, because 50 digits leave enough after
# cancellation.

import random
from itertools import product
from math import inf, nextafter

from mpmath import asin, atan2, cos, floor, hypot, mp, mpf, nstr, pi, radians, sin, sqrt, tan

mp.dps = 50
TURN = 2 * pi
INPUTS = 8  # columns; Algorithm 1 needs the most
rng = random.Random(20210309)

# Table 2: step in degrees, steps per turn, seconds per turn.
MODES = [(0.3, 1200, 21.6), (0.6, 600, 10.8), (0.9, 400, 8.0), (1.2, 300, 6.6), (2.4, 150, 4.8)]


def wrap(angle, period=TURN):
    """Wrap into [0, period)."""
    return angle - period * floor(angle / period)


# ---- The paper's equations ----


def eq6(h, theta, m):
    assert m * theta < pi / 2, "the floor ends at 90 degrees"
    return h * (tan(m * theta) - tan((m - 1) * theta))


def eq8(h, theta, m):
    # This computes the sum itself, not its closed form h tan(m theta) / m.
    return sum(eq6(h, theta, mpf(k)) for k in range(1, int(m) + 1)) / m


def footprint(h, alpha, zeta):
    assert abs(alpha) + zeta / 2 < pi / 2
    return h * (tan(alpha + zeta / 2) - tan(alpha - zeta / 2))


def algorithm1(k, s, t_turn, x, v, alpha0, growing, is_reversed):
    """Algorithm 1 with the erratum: ssector and ssize are both 2 pi / s, Ts is a sector's period 2 T / s.

    One more departure: line 10 keeps t = Ts, for which line 18 gives an angle two sectors further on. The wave is back
    at its start then, so t is taken from [0, Ts).
    """
    size = TURN / s
    period = 2 * t_turn / s
    t = period * (alpha0 if growing > 0 else 2 * size - alpha0) / (2 * size)
    half_laps = wrap(t - x / v, period) / (period / 2)
    in_sector = size * (half_laps if floor(half_laps) % 2 == 0 else 2 - half_laps)
    alpha = in_sector + size * k
    return wrap(TURN - alpha if is_reversed else alpha)


# ---- Straight tunnels: wall hits of beams ----

RECTANGLE, CIRCLE, TRIMMED = 0, 1, 2
HALF_WIDTH, HEIGHT = mpf(2), mpf(3)
RADIUS = {CIRCLE: mpf(3), TRIMMED: mpf(6.05)}
HALF_FLOOR = {CIRCLE: mpf(0), TRIMMED: mpf(10.4) / 2}  # a circle is a trimmed one without a floor
CENTRE = {shape: sqrt(RADIUS[shape] ** 2 - HALF_FLOOR[shape] ** 2) for shape in RADIUS}
FLOOR_ANGLE = {shape: asin(HALF_FLOOR[shape] / RADIUS[shape]) for shape in RADIUS}  # of the left corner, from below


def perimeter(shape):
    if shape == RECTANGLE:
        return 4 * HALF_WIDTH + 2 * HEIGHT
    return 2 * HALF_FLOOR[shape] + RADIUS[shape] * (TURN - 2 * FLOOR_ANGLE[shape])


def inside(shape, y, z):
    if shape == RECTANGLE:
        return abs(y) < HALF_WIDTH and 0 < z < HEIGHT
    return z > 0 and hypot(y, z - CENTRE[shape]) < RADIUS[shape]


def direction(yaw, pitch, alpha):
    """Rz(yaw) Ry(pitch) (0, sin alpha, -cos alpha)."""
    across, up = sin(alpha), -cos(alpha)
    ahead, up = up * sin(pitch), up * cos(pitch)
    return ahead * cos(yaw) - across * sin(yaw), ahead * sin(yaw) + across * cos(yaw), up


def cast(shape, y, z, yaw, pitch, alpha):
    """x, y, z and sigma of the hit. The sections are convex, so the first wall ahead is the one that is hit."""
    assert inside(shape, y, z)
    dx, dy, dz = direction(yaw, pitch, alpha)
    walls = []  # distance, and sigma of a point on that wall
    if dz < 0:
        walls.append((-z / dz, lambda y, z: y))
    if shape == RECTANGLE:
        if dy > 0:
            walls.append(((HALF_WIDTH - y) / dy, lambda y, z: HALF_WIDTH + z))
        if dz > 0:
            walls.append(((HEIGHT - z) / dz, lambda y, z: 2 * HALF_WIDTH + HEIGHT - y))
        if dy < 0:
            walls.append(((-HALF_WIDTH - y) / dy, lambda y, z: 3 * HALF_WIDTH + 2 * HEIGHT - z))
    else:
        r, up = RADIUS[shape], z - CENTRE[shape]
        a, b, c = dy**2 + dz**2, y * dy + up * dz, y**2 + up**2 - r**2
        corner, half_floor = FLOOR_ANGLE[shape], HALF_FLOOR[shape]

        def along_arc(y, z):
            return half_floor + r * (wrap(atan2(y, CENTRE[shape] - z)) - corner)

        walls.append(((-b + sqrt(b**2 - a * c)) / a, along_arc))
    t, sigma = min(walls, key=lambda wall: wall[0])
    y, z = y + t * dy, z + t * dz
    return t * dx, y, z, wrap(sigma(y, z), perimeter(shape))


def step(shape, y, z, yaw, pitch, alpha, theta):
    """Distance between the hits at alpha and alpha + theta, on the unrolled wall."""
    here, there = cast(shape, y, z, yaw, pitch, alpha), cast(shape, y, z, yaw, pitch, alpha + theta)
    around = abs(there[3] - here[3])
    return hypot(there[0] - here[0], min(around, perimeter(shape) - around))


# ---- Inputs ----


def rad(degrees):
    return float(radians(mpf(str(degrees))))


def span(low, high):
    """Log-uniform between low and high: lengths and speeds differ by factors, not by amounts."""
    return float(low * (mpf(high) / low) ** rng.random())  # mp, because powers of doubles differ between machines


STEPS = [rad(mode[0]) for mode in MODES]
LAPS = [mode[2] for mode in MODES]
BEAMS = [rad(2.4), rad(1.4)]
SPEEDS = [1e-9, 1e-6, 1e-3, 0.05, 0.197, 0.5, 1.0, 3.0]
NEAR_RIGHT_ANGLE = [1e-6, 1e-9, 5e-10, 1e-12]  # remainder to 90 degrees
HEIGHTS = [1e-3, 0.5, 1.5, 3.0, 3.092, 10.0]


def several(make, rows=26):
    return [make() for _ in range(rows)]


def height():
    return rng.choice(HEIGHTS)


def legs(*first):
    """Travel d and spacing ty, with d often small, tiny or zero; `before` holds the equation's first arguments."""
    travels = [span(1e-6, 0.1) for _ in range(20)] + [0.0, 0.0, 1e-11, 1e-11, 0.3, 3.0]
    return [(*(draw() for draw in first), d, span(1e-3, 3.0)) for d in travels]


def diagonals():
    return legs(lambda: span(0.01, 5.0))


def eq5_inputs():
    angles = STEPS + [1e-9, 1e-6, rad(10), rad(45), rad(89), rad(89.99)]
    angles += [float(pi / 2 - left) for left in NEAR_RIGHT_ANGLE]
    return [(height(), theta) for theta in angles * 2]


def eq7_inputs():
    return [(height(), theta) for theta in (STEPS + [1e-9, 1e-6, 0.5, 2.0, float(pi)]) * 3]


def eq6_inputs():
    for theta, (_, steps, _) in zip(STEPS, MODES):
        last = next(m for m in range(steps // 4, 0, -1) if m * 360 < steps * 90)
        for m in (1, 2, last // 2, last - 1, last):
            yield height(), theta, m
    for m in (1, 2, 7, 64, 300):  # some products m theta are exact (powers of 2), some aren't
        yield height(), float(radians(mpf("89.99")) / m), m
        for left in NEAR_RIGHT_ANGLE:
            yield height(), float((pi / 2 - left) / m), m
    for m in (1, 2, 1000, 10**9):
        yield height(), 1e-9, m


def eq8_inputs():
    for theta, (_, steps, _) in zip(STEPS, MODES):
        for m in (1, 2, steps // 8, (steps - 1) // 4):
            yield height(), theta, m
    for m in (1, 2, 7, 64):
        yield height(), float(radians(mpf("89.99")) / m), m
        yield height(), float((pi / 2 - mpf("1e-9")) / m), m
    yield 1.5, 1e-9, 100


def speed_inputs():
    for (_, steps, lap), s in product(MODES, (1, 2, 4)):
        target = rng.uniform(0.1, 3.0)
        yield target, target * rng.random(), lap / s, lap / steps
    for below in (1e-3, 1e-6, 1e-9, 1e-12, 3e-13, 1e-14, 1e-15):
        target = rng.uniform(0.1, 3.0)
        yield target, target * (1 - below), 10.8, 0.018
    for target in (0.1, 0.3, 0.5, 2.0):
        yield target, nextafter(target, 0), 4.8, 0.032
        yield target, target, 4.8, 0.032
    yield 1e-9, 5e-10, 21.6, 0.018
    yield 0.5, 1e-12, 2.4, 0.032


def phase_inputs():
    """phi, omega, x, v."""
    for v, x in product(SPEEDS, (0.0, 0.3, 1.102, 3.0)):
        s = rng.randint(2, 6)
        yield float(TURN * rng.randrange(s) / s), float(TURN / rng.choice(LAPS)), x, v
    for s, lap in zip((2, 3, 4, 5, 6), LAPS):
        omega = float(TURN / lap)
        # Heads that are apart by the travel of a whole turn, and by so much that rounding absorbs the shift.
        yield float(TURN / s), omega, 0.197 * lap, 0.197
        yield float(TURN / s), omega, 0.197 * lap / s, 0.197
        yield float(TURN / s), -omega, 1.102, 0.197
    yield 0.0, 1.0, 0.0, 1.0
    yield 0.0, 1.0, 1e-12, 1.0
    yield float(TURN), 1.0, 0.0, 1.0


def eq22_inputs():
    return [*product(BEAMS, STEPS)] + several(lambda: (span(1e-3, 0.1), span(1e-4, 0.1)), 15)


def footprint_inputs():
    for alpha, zeta in product([0.0, rad(1), rad(30), rad(-45), rad(60), rad(80), rad(-85), rad(88)], BEAMS):
        yield height(), alpha, zeta
    for zeta in BEAMS:
        yield height(), float(radians(mpf("89.99")) - mpf(zeta) / 2), zeta
        for left in NEAR_RIGHT_ANGLE:
            yield height(), float(pi / 2 - left - mpf(zeta) / 2), zeta
    yield 1.5, float(-(pi / 2 - mpf("1e-9") - mpf(BEAMS[0]) / 2)), BEAMS[0]
    for alpha in (0.0, 1.0, rad(89.99)):
        yield 1.5, alpha, 1e-9


def algorithm1_inputs():
    """k, s, t_turn, x, v, alpha0, growing, reversed."""
    heads = [(k, s) for s in range(2, 7) for k in range(s)]
    for number, (k, s) in enumerate(heads * 2):
        x, v = rng.choice((0.0, 0.3, 1.102, 3.0)), rng.choice((0.05, 0.197, 0.5, 1.0))
        alpha0 = float(TURN / s * rng.random())
        yield k, s, rng.choice(LAPS), x, v, alpha0, rng.choice((1, -1)), number % 3 == 0
    for s in range(2, 7):
        # Turning points of the wave: at the sector's start, before and after, and at its end.
        end = float(TURN / s)
        yield 1, s, 8.0, 0.0, 0.197, 0.0, 1, 0
        yield 1, s, 8.0, 0.0, 0.197, 0.0, -1, 0
        yield s - 1, s, 8.0, 0.0, 0.197, end, 1, 0
        yield s - 1, s, 8.0, 0.0, 0.197, end, -1, 1
        # A delay slightly beyond the start: t is just below 0, and rounds to Ts.
        yield s - 1, s, 10.8, 1e-18, 1.0, 0.0, 1, 0


BOXES = {RECTANGLE: (1.9, 0.1, 2.9), CIRCLE: (1.9, 1.0, 5.0), TRIMMED: (3.5, 0.2, 7.0)}  # well inside: |y|, and z from, to


def off_wall(shape, angle, gap):
    """A head `gap` off the arc, at an angle from below as seen from the centre."""
    r = RADIUS[shape] - mpf(gap)
    return float(r * sin(angle)), float(CENTRE[shape] - r * cos(angle))


def towards(head, yaw, pitch, point):
    """The alpha whose beam passes through a point of the section, from dy / dz of `direction`."""
    ahead, up = mpf(point[0]) - head[0], mpf(point[1]) - head[1]
    across = ahead * cos(pitch) - up * sin(pitch) * sin(yaw)
    return atan2(across, -up * cos(yaw))


def corner_rays(shape, head, yaw, pitch, corner):
    at = float(wrap(towards(head, yaw, pitch, corner)))
    for alpha in (at, nextafter(at, inf), nextafter(at, -inf), at + 9e-10, at - 9e-10):
        yield shape, *head, yaw, pitch, alpha


def rays():
    """shape, y, z, yaw, pitch, alpha."""
    for shape, (y, low, high) in BOXES.items():
        for _ in range(5):
            tilt = float(radians(rng.uniform(-30, 30))), float(radians(rng.uniform(-20, 20)))
            yield shape, rng.uniform(-y, y), rng.uniform(low, high), *tilt, rng.uniform(0, float(TURN))
        yield shape, 0.5, 2.0, rad(30), rad(-20), rad(77)
        # On the seam of sigma and to either side.
        for alpha in (0.0, -1e-12, 1e-12, float(TURN)):
            yield shape, 0.0, 1.5, 0.0, 0.0, alpha
    # 1 mm off a wall, looking at it, away from it and along it.
    yield RECTANGLE, 1.999, 1.5, 0.1, -0.05, 1.4
    yield RECTANGLE, -1.999, 0.7, -0.4, 0.2, 1.7
    yield RECTANGLE, 0.3, 0.001, 0.0, 0.3, rad(89.99)
    yield RECTANGLE, -0.5, 2.999, 0.5, 0.0, rad(90.01)
    for shape, angle in ((CIRCLE, 2.0), (CIRCLE, 5.0), (TRIMMED, 1.2), (TRIMMED, 3.0)):
        head = off_wall(shape, angle, 1e-3)
        yield shape, *head, 0.0, 0.0, angle
        yield shape, *head, 0.2, -0.1, angle + float(pi / 2)
    yield TRIMMED, 5.198, 0.001, 0.1, 0.1, rad(269.9)
    # Beams 89.99 degrees and more off the normal of the wall that they hit. In such a small section, the head must be
    # even nearer to the wall.
    yield RECTANGLE, 0.2, 1e-4, 0.0, 0.0, rad(89.99)
    yield RECTANGLE, 1.9999, 1.0, 0.0, 0.0, rad(0.01)
    yield RECTANGLE, -1.9999, 1.0, 0.3, 0.0, rad(180.01)
    yield TRIMMED, 0.5, 1e-4, 0.0, 0.0, rad(89.99)
    yield TRIMMED, -0.5, 1e-4, 0.0, 0.2, rad(270.01)
    yield CIRCLE, *off_wall(CIRCLE, 2.5, 1e-8), 0.0, 0.0, float(2.5 + pi / 2)
    yield TRIMMED, *off_wall(TRIMMED, 4.0, 1e-8), 0.0, 0.0, float(4 - pi / 2)
    # Through a corner and to either side of it.
    left = float(HALF_FLOOR[TRIMMED])
    yield from corner_rays(RECTANGLE, (0.0, 1.5), 0.0, 0.0, (2.0, 3.0))
    yield from corner_rays(RECTANGLE, (0.7, 0.9), 0.5, -0.3, (-2.0, 0.0))
    yield from corner_rays(TRIMMED, (0.0, 3.0), 0.0, 0.0, (left, 0.0))
    yield from corner_rays(TRIMMED, (1.1, 2.2), -0.4, 0.25, (-left, 0.0))


def step_inputs():
    for (shape, (y, low, high)), theta in product(BOXES.items(), STEPS + [rad(-0.9), 1e-9]):
        tilt = float(radians(rng.uniform(-30, 30))), float(radians(rng.uniform(-20, 20)))
        yield shape, rng.uniform(-y, y), rng.uniform(low, high), *tilt, rng.uniform(0, float(TURN)), theta
    for shape, theta in product(BOXES, (rad(2.4), rad(-2.4), 1e-9)):
        yield shape, 0.1, 1.4, 0.0, 0.0, -theta / 3 - float(atan2(mpf(0.1), mpf(1.4))), theta  # across the seam
    left = float(HALF_FLOOR[TRIMMED])
    for shape, head, yaw, pitch, corner in (
        (RECTANGLE, (0.0, 1.5), 0.0, 0.0, (-2.0, 0.0)),
        (RECTANGLE, (1.2, 0.4), 0.5, -0.3, (2.0, 3.0)),
        (TRIMMED, (0.0, 3.0), 0.0, 0.0, (left, 0.0)),
        (TRIMMED, (1.1, 2.2), -0.4, 0.25, (-left, 0.0)),
    ):
        for theta in (rad(0.3), rad(2.4)):
            yield shape, *head, yaw, pitch, float(towards(head, yaw, pitch, corner)) - theta / 3, theta
    yield RECTANGLE, 1.999, 1.5, 0.0, 0.0, rad(88), rad(2.4)  # 1 mm off the wall under the beam
    yield RECTANGLE, 0.0, 0.001, 0.0, 0.1, rad(88), rad(0.3)
    yield CIRCLE, *off_wall(CIRCLE, 2.0, 1e-3), 0.0, 0.0, 2.0 + rad(88), rad(1.2)
    yield TRIMMED, *off_wall(TRIMMED, 3.0, 1e-3), 0.1, 0.1, 3.0, rad(2.4)


RAYS = list(rays())
PHASES = list(phase_inputs())
CASES = [
    ("eq5", lambda h, theta: h * tan(theta), eq5_inputs()),
    ("eq6", eq6, eq6_inputs()),
    ("eq7", lambda r, theta: 2 * r * sin(theta / 2), eq7_inputs()),
    ("eq8", eq8, eq8_inputs()),
    ("eq10", lambda p, n: p / n, several(lambda: (span(1.0, 60.0), rng.choice(MODES)[1]))),
    ("eq11", lambda v, ts: v * ts, several(lambda: (rng.choice(SPEEDS), span(1e-3, 0.1)))),
    ("eq12", lambda v, t: v * t, product(SPEEDS, LAPS)),
    ("eq13", hypot, legs()),
    ("eq15", lambda n, d, typ: hypot(n * d, typ), legs(lambda: rng.choice(MODES)[1])),
    *((case, lambda tx, d, ty: hypot(tx + d, ty), diagonals()) for case in ("eq16", "eq17", "eq18")),
    ("eq16_speed", lambda target, ty2, gap, ts: sqrt(target**2 - ty2**2) / (gap + ts), speed_inputs()),
    ("eq20", lambda phi, omega, x, v: wrap(phi - omega * x / v), PHASES),
    ("eq21", lambda phi, omega, x, v: wrap(TURN - (phi - omega * x / v)), PHASES),
    ("eq22", lambda zeta, theta: zeta / theta, eq22_inputs()),
    ("footprint", footprint, footprint_inputs()),
    ("algorithm1", algorithm1, algorithm1_inputs()),
    *((f"cast_{name}", lambda *ray, at=at: cast(*ray)[at], RAYS) for at, name in enumerate(("x", "y", "z", "sigma"))),
    ("step", step, step_inputs()),
    ("perimeter", perimeter, [(shape,) for shape in (RECTANGLE, CIRCLE, TRIMMED)]),
]

print("case", *(f"i{i}" for i in range(1, INPUTS + 1)), "value", sep=",")
print("# Made by sampling.py, not by hand. Wrapped angles and sigma are cyclic: 0 may meet a whole period.")
for case, formula, rows in CASES:
    for row in rows:
        inputs = [float(i) for i in row]
        value = formula(*(mpf(i) for i in inputs))
        columns = [repr(i) for i in inputs] + [""] * (INPUTS - len(inputs))
        print(case, *columns, nstr(value, 25), sep=",")
