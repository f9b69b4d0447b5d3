# Reference values for the factored covariance, at 100 digits:
#   python3 tests/oracles/fusion.py > tests/oracles/fusion.csv
#
# Each case is a sequence of steps on a covariance P of n errors, computed by the textbook's formulas without factors.
# These formulas lose up to 60 digits, so 50 would be too few. A run with 200 digits must give the same 20.
#   start     n variances                  P = diag
#   measure   noise, h (n)                 P - P h h^T P / s,  s = h^T P h + noise
#   add       variance, a (n)              P + variance a a^T
#   shear     the n (n - 1) / 2 values above the diagonal of F (1 on it), by rows       F P F^T
#   scale     number of the error, factor  the same with a diagonal F
# and the expected results:
#   gain      s and P h / s (n) of the last measurement, with P as before it
#   distance  e (n), and e^T P^-1 e
#   is        the n (n + 1) / 2 values of P, by rows from the diagonal on
# Needs mpmath. Inputs are doubles and count as exact; values are rounded to 20 digits.

import random

from mpmath import diag, matrix, mp, mpf, nstr

rng = random.Random(19770301)


def short(x):
    """A double with few digits, which keeps the file small."""
    return float(f"{x:.4g}")


def row(n, spread=1.0):
    return [short(rng.uniform(-spread, spread)) for _ in range(n)]


def above(n, spread):
    return row(n * (n - 1) // 2, spread)


# ---- Sequences ----


def mixed(n, start, noises, variances, spread, count):
    """Steps of all kinds in random order."""
    steps = [("start", *start)]
    for _ in range(count):
        kind = rng.choice(["measure", "measure", "add", "shear", "scale"])
        if kind == "measure":
            steps += [("measure", rng.choice(noises), *row(n)), ("gain",)]
        elif kind == "add":
            steps.append(("add", rng.choice(variances), *row(n)))
        elif kind == "shear":
            steps.append(("shear", *above(n, spread)))
        else:
            steps.append(("scale", rng.randrange(n), short(rng.uniform(0.2, 1.5))))
    steps += [("measure", rng.choice(noises), *row(n)), ("gain",), ("distance", *row(n)), ("is",)]
    return steps


def chain(n, dt):
    """Each error drives the one before it: position, velocity, acceleration, ..."""
    entries = []
    for i in range(n):
        term = 1.0
        for j in range(i + 1, n):
            term *= dt / (j - i)
            entries.append(short(term))
    return ("shear", *entries)


def one(n, i, value=1.0):
    return [value if k == i else 0.0 for k in range(n)]


def drift(n, dt, times, noise):
    """A long drift, followed by precise fixes of the position at intervals."""
    steps = [("start", *[10.0 ** -(2 * k) for k in range(n)])]
    for _ in range(times):
        steps += [chain(n, dt), ("add", 1e-6, *one(n, n - 1))]
    steps.append(("is",))
    for _ in range(n + 1):
        steps += [("measure", noise, *one(n, 0)), ("gain",), ("is",), chain(n, 1.0), ("add", 1e-12, *one(n, n - 1))]
    return [*steps, ("is",)]


def unknown_then_known(n, prior, noise):
    """Unknown errors that become known: one measurement of each error, and then a second one."""
    rows = [row(n) for _ in range(n)]
    steps = [("start", *[prior] * n)]
    for h in rows + rows:
        steps += [("measure", noise, *h), ("is",)]
    return steps


def nearly_parallel(n, prior, noise, apart):
    """Measurements that separate the errors only by the difference of two rows."""
    steps = [("start", *[prior] * n), ("measure", noise, *[1.0] * n), ("is",)]
    for i in range(n):
        h = [1.0 + (apart if k == i else 0.0) for k in range(n)]
        steps += [("measure", noise, *h), ("gain",), ("is",)]
    return steps


def swinging(n):
    """Noise of 1e-10 and 1e10 in turn, on errors of all sizes that a shear has coupled."""
    steps = [("start", *[10.0 ** (14 - 6 * k) for k in range(n)]), ("shear", *above(n, 1e3))]
    for k in range(3 * n):
        steps += [("measure", 1e-10 if k % 2 == 0 else 1e10, *row(n)), ("gain",)]
        if k % 3 == 2:
            steps += [("is",), ("add", 1e-8, *row(n)), ("shear", *above(n, 1.0))]
    return [*steps, ("is",)]


CASES = [
    ("mild", 4, mixed(4, [1.0, 2.0, 0.5, 0.1], [0.1, 1.0], [0.01, 0.1], 1.0, 12)),
    ("mild", 6, mixed(6, [1.0, 2.0, 0.5, 0.1, 3.0, 0.7], [0.1, 1.0], [0.01, 0.1], 1.0, 16)),
    ("ill_scaled", 4, mixed(4, [1e14, 1e4, 1.0, 1e-8], [1e-10, 1e10, 1e-4], [1e-12, 1e4], 10.0, 14)),
    ("ill_scaled", 6, mixed(6, [1e14, 1e14, 1e4, 1.0, 1e-4, 1e-8], [1e-10, 1e10], [1e-12, 1e4], 10.0, 18)),
    ("exact_prior", 4, mixed(4, [0.0, 1e14, 0.0, 1.0], [1e-4], [1e-6], 1.0, 10)),
    ("drift", 4, drift(4, 1800.0, 20, 1e-4)),
    ("drift", 6, drift(6, 30.0, 4, 1e-10)),
    ("unknown_then_known", 4, unknown_then_known(4, 1e14, 1e-4)),
    ("unknown_then_known", 6, unknown_then_known(6, 1e14, 1e-10)),
    ("nearly_parallel", 4, nearly_parallel(4, 1e14, 1e-4, 2.0**-20)),
    ("nearly_parallel", 6, nearly_parallel(6, 1.0, 1e-10, 2.0**-12)),
    ("swinging", 4, swinging(4)),
    ("swinging", 6, swinging(6)),
]


# ---- The textbook ----


def upper(n, entries):
    entries, f = iter(entries), matrix(n, n)
    for i in range(n):
        f[i, i] = mpf(1)
        for j in range(i + 1, n):
            f[i, j] = mpf(next(entries))
    return f


def column(values):
    return matrix([mpf(v) for v in values])


def follow(n, steps):
    """The steps with their expected results."""
    p, gain = None, None
    for kind, *inputs in steps:
        outputs = []
        if kind == "start":
            p = diag([mpf(v) for v in inputs])
        elif kind == "measure":
            h = column(inputs[1:])
            ph = p * h
            s = (h.T * ph)[0] + mpf(inputs[0])
            gain = [s, *(ph / s)]
            p = p - ph * ph.T / s
        elif kind == "add":
            a = column(inputs[1:])
            p = p + mpf(inputs[0]) * a * a.T
        elif kind == "shear":
            f = upper(n, inputs)
            p = f * p * f.T
        elif kind == "scale":
            f = diag([mpf(1)] * n)
            f[inputs[0], inputs[0]] = mpf(inputs[1])
            p = f * p * f.T
        elif kind == "gain":
            outputs = gain
        elif kind == "distance":
            e = column(inputs)
            outputs = [(e.T * (p**-1) * e)[0]]
        else:
            outputs = [p[i, j] for i in range(n) for j in range(i, n)]
        yield kind, inputs, [nstr(value, 20) for value in outputs]


print("# Made by fusion.py, not by hand: case, n, step, its inputs, and what must come of it.")
for name, n, steps in CASES:
    mp.dps = 200
    again = list(follow(n, steps))
    mp.dps = 100
    lines = list(follow(n, steps))
    assert lines == again, f"{name}: 100 digits are not enough"
    for kind, inputs, outputs in lines:
        print(name, n, kind, *(repr(i) for i in inputs), *outputs, sep=",")
