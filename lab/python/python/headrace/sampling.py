"""Sampling theory: the spacing of samples on the wall, and the largest speed of a vehicle.

The closed forms are those of Jorge et al., Sensors 2021, 21, 1900. ``Profile.t_y_at_rest_m`` covers any profile. ``plan`` plans
for a vehicle file and allows for all margins.

    >>> from math import radians
    >>> from headrace.sampling import Turn, speed_for_target_mps, t_y2_m
    >>> turn = Turn(radians(0.9), 8.0)
    >>> round(speed_for_target_mps(0.5, t_y2_m(3.0, turn.step_rad, 50), turn.period_s / 4, turn.ping_period_s), 3)
    0.242
"""

from __future__ import annotations

import json
import os
from typing import List, Optional, TypedDict, Union

from ._headrace import (
    Spiral,
    Turn,
    beam_width_m,
    footprint_m,
    overlap,
    plan_json,
    range_resolution_m,
    speed_for_target_mps,
    t_c_m,
    t_max_m,
    t_y1_m,
    t_y2_m,
    t_y2_mean_m,
    t_yp_m,
)

__all__ = [
    "Answer",
    "Margins",
    "Spacing",
    "Spiral",
    "Turn",
    "beam_width_m",
    "footprint_m",
    "overlap",
    "plan",
    "range_resolution_m",
    "speed_for_target_mps",
    "t_c_m",
    "t_max_m",
    "t_y1_m",
    "t_y2_m",
    "t_y2_mean_m",
    "t_yp_m",
]


class Spacing(TypedDict):
    """Distances between samples at the speed ``speed_mps`` of the answer, m."""

    advance_m: float
    pitch_m: float
    t_x_m: float
    t_x_hidden_m: float
    t_y_min_m: float
    t_y_mean_m: float
    t_y_max_m: float
    t_min_m: float
    t_mean_m: float
    t_max_m: Optional[float]
    hit_once_m: Optional[float]
    hit_twice_m: Optional[float]


class Margins(TypedDict):
    """The largest speed after each margin, m/s. Each value also includes all margins before it, so ``losses_mps`` is v_max.

    ``geometry_mps`` has no margin: the heads are evenly phased, and all of them see the whole wall. The margins are the wall that the
    vehicle hides, the heads' phases and positions, swing, position errors, and lost returns (none in a plan). ``pass_error_m`` is the
    standard deviation of the displacement between two passes, m.
    """

    geometry_mps: float
    hidden_mps: float
    phase_mps: float
    swing_mps: float
    position_mps: float
    losses_mps: float
    pass_error_m: float


class Answer(TypedDict):
    """The plan for one mode, with the keys of ``modes`` in ``headrace plan --json``. docs/why/coverage.md explains the terms."""

    mode: str
    step_deg: float
    steps_per_turn: int
    turn_s: float
    turn_basis: str
    overlap: float
    t_y_min_rest_m: float
    t_y_mean_rest_m: float
    t_y_max_rest_m: float
    t_yp_m: float
    t_y2_m: float
    v_max_mps: Optional[float]
    margins: Optional[Margins]
    needed_h: Optional[float]
    reason: Optional[str]
    refused: Optional[str]
    speed_mps: Optional[float]
    spacing: Optional[Spacing]
    position_margin_m: float
    meets_target: Optional[bool]
    suffices: Optional[bool]
    best: bool


def plan(
    vehicle: Union[str, "os.PathLike[str]"],
    *,
    target_m: Optional[float] = None,
    speed_mps: Optional[float] = None,
    time_s: Optional[float] = None,
    drift_m: float = 0.0,
    yaw_rad: float = 0.0,
    yaw_rate_radps: float = 0.0,
) -> List[Answer]:
    """Plans for all modes of a vehicle's heads, as ``headrace plan --vehicle`` does.

    ``target_m`` defaults to the vehicle file's. With ``speed_mps`` or ``time_s`` (for the whole tunnel), the answers state whether it
    meets the target. ``drift_m`` is the largest offset from the tunnel's middle, ``yaw_rad`` the largest constant yaw from its axis,
    and ``yaw_rate_radps`` the largest yaw rate.

    Raises ConfigError if the vehicle file can't be read or is wrong, SamplingError for an argument out of range.
    """
    answers: List[Answer] = json.loads(
        plan_json(
            os.fspath(vehicle),
            target_m=target_m,
            speed_mps=speed_mps,
            time_s=time_s,
            drift_m=drift_m,
            yaw_rad=yaw_rad,
            yaw_rate_radps=yaw_rate_radps,
        )
    )
    return answers
