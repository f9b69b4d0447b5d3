"""A program against the package's types: checked by mypy --strict, not run."""

from pathlib import Path
from typing import Optional

import numpy

import headrace
from headrace import sampling


def longest_gap_s(log: headrace.Log, source: str) -> float:
    times_ns = [message.log_time_ns for message in log.messages(source) if message.kind == "raw"]
    return max((b - a for a, b in zip(times_ns, times_ns[1:])), default=0) / 1e9


def speed_mps(profile: headrace.Profile, turn: sampling.Turn, heads: int, target_m: float) -> Optional[float]:
    y_m, z_m = profile.reference_m
    _, _, most_m = profile.t_y_at_rest_m(y_m, z_m, turn)
    return sampling.speed_for_target_mps(target_m, most_m, turn.period_s / heads, turn.ping_period_s)


def fastest(vehicle: Path) -> Optional[str]:
    answers = sampling.plan(vehicle, target_m=0.5)
    best = [answer["mode"] for answer in answers if answer["best"]]
    spacing = answers[0]["spacing"]
    if spacing is not None and spacing["t_x_m"] > 1.0:
        return None
    return best[0] if best else None


def judged(log: Path, profile: headrace.Profile) -> headrace.Table:
    points = numpy.zeros((10, 3))
    arcs_m = profile.arc_m(points[:, 1], points[:, 2])
    table: headrace.Table = headrace.holes(points[:, 0], arcs_m, perimeter_m=profile.perimeter_m)
    names: list[str] = table.column_names
    try:
        tables = headrace.replay([log], target_m=0.3, smooth=True)
    except headrace.HeadraceError as error:
        where: Optional[str] = error.place
        raise SystemExit(f"{error.file}, {where}, {names}") from error
    return tables.sections
