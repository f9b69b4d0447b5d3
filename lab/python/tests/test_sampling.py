"""Sampling theory, compared with the paper's tables, with values computed by hand and with the program's plan."""

import csv
import json
import math
import subprocess
from pathlib import Path

import pytest

import headrace
from headrace import Profile, sampling
from headrace.sampling import Spiral, Turn

#: Folder of the paper's tables, next to the repository.
PAPER = Path(__file__).resolve().parents[4] / "shared" / "paper"
SPEED_MPS = 0.197


def paper(name):
    if not (PAPER / name).is_file():
        pytest.skip(f"skipped: {name} of the paper is not there")
    with open(PAPER / name) as file:
        return list(csv.DictReader(file))


def modes():
    return {
        row["mode"]: Turn(math.radians(float(row["step_deg"])), float(row["period_s"]))
        for row in paper("table2-modes.csv")
    }


def test_modes_match_table_2_of_the_paper():
    for row in paper("table2-modes.csv"):
        turn = modes()[row["mode"]]
        assert turn.steps == int(row["samples_per_rev"])
        assert 1 / turn.ping_period_s == pytest.approx(float(row["samples_per_s"]), abs=0.01)


def test_spacings_match_table_4_of_the_paper():
    perimeter_m = Profile.ceran_blueprint().perimeter_m
    assert perimeter_m == pytest.approx(34.17, abs=1e-9)
    compared = 0
    for row in paper("table4-multi-head.csv"):
        turn, heads = modes()[row["mode"]], int(row["heads"])
        phase = Spiral(SPEED_MPS, turn, heads)
        sector = Spiral(SPEED_MPS, turn, heads / 2)
        # The paper's baselines belong to a speed that differs from the stated speed by up to 0.6 %.
        assert phase.t_x_m == pytest.approx(float(row["base_phase_tx"]), rel=0.007)
        assert sector.t_x_m == pytest.approx(float(row["base_sector_tx"]), rel=0.007)
        # In the paper, the rows of FAST with 3 and 4 heads repeat the rows of FASTER.
        if not (row["mode"] == "FAST" and heads > 2):
            mean_m = sampling.t_yp_m(perimeter_m, turn.steps)
            assert mean_m == pytest.approx(float(row["base_ty_mean"]), abs=0.0025)
            compared += 1
    assert compared == 13


def test_combined_spacings_match_table_5_of_the_paper():
    spacings = {(row["mode"], row["heads"]): row for row in paper("table4-multi-head.csv")}
    for row in paper("table5-combined.csv"):
        of = spacings[row["mode"], row["heads"]]
        for layout in ("phase", "sector"):
            for size in ("mean", "max"):
                t_m = sampling.t_max_m(float(of[f"{layout}_tx"]), 0.0, float(of[f"{layout}_ty_{size}"]))
                assert t_m == pytest.approx(float(row[f"{layout}_t_{size}"]), abs=0.0035), row


def test_functions_match_values_computed_by_hand():
    fast = Turn(math.radians(0.9), 8.0)
    assert fast.steps == 400 and fast.rate_radps == pytest.approx(math.tau / 8)
    four = Spiral(SPEED_MPS, fast, 4.0)
    assert four.advance_m == pytest.approx(0.00394, abs=1e-15)
    assert four.pitch_m == pytest.approx(1.576) and four.t_x_m == pytest.approx(0.394)
    assert four.t_max_m(0.18) == pytest.approx(math.hypot(0.39794, 0.18))
    assert four.t_y_max_m(0.3) == pytest.approx(math.hypot(0.00394, 0.3))
    assert four.t_y_min_m(0.05) == pytest.approx(math.hypot(0.00394, 0.05))
    assert four.t_y_mean_m(0.085) == pytest.approx(math.hypot(0.00394, 0.085))
    assert four.t_y_mean_printed_m(0.085) == pytest.approx(math.hypot(1.576, 0.085))
    assert four.t_mean_m(0.1) == four.t_max_m(0.1) == four.t_min_m(0.1)
    step = math.radians(0.9)
    assert sampling.t_y1_m(4.571, step) == pytest.approx(4.571 * math.tan(step))
    assert sampling.t_y2_m(2.0, step, 50) == pytest.approx(2 * (math.tan(50 * step) - math.tan(49 * step)))
    assert sampling.t_y2_mean_m(2.0, step, 50) == pytest.approx(2 * math.tan(50 * step) / 50)
    assert sampling.t_c_m(6.05, step) == pytest.approx(2 * 6.05 * math.sin(step / 2))
    assert sampling.overlap(math.radians(2.4), math.radians(0.3)) == pytest.approx(8)
    assert sampling.range_resolution_m(0.0, 10.0, 1000) == pytest.approx(0.01)
    assert sampling.beam_width_m(10.0, math.radians(1.4)) == pytest.approx(20 * math.tan(math.radians(0.7)))
    half = math.radians(0.7)
    expected = 3 * (math.tan(0.5 + half) - math.tan(0.5 - half))
    assert sampling.footprint_m(3.0, 0.5, 2 * half) == pytest.approx(expected)


def test_speed_for_a_target_meets_the_target():
    turn = Turn(math.radians(0.9), 8.0)
    v_mps = sampling.speed_for_target_mps(0.5, 0.3, turn.period_s / 4, turn.ping_period_s)
    assert Spiral(v_mps, turn, 4.0).t_max_m(0.3) == pytest.approx(0.5)
    assert sampling.speed_for_target_mps(0.5, 0.5, 2.0, 0.02) is None


def test_head_at_the_centre_of_a_circle_has_equal_steps():
    circle, turn = Profile.circle(3.0), Turn(math.radians(1.2), 6.6)
    y_m, z_m = circle.reference_m
    least_m, mean_m, most_m = circle.t_y_at_rest_m(y_m, z_m, turn)
    t_c_m = sampling.t_c_m(3.0, turn.step_rad)
    assert least_m == pytest.approx(t_c_m) and mean_m == pytest.approx(t_c_m) and most_m == pytest.approx(t_c_m)
    assert circle.perimeter_m == pytest.approx(math.tau * 3)
    assert circle.clock(0.0) == "6:00" and circle.clock(circle.perimeter_m / 4) == "9:00"


def test_points_are_unrolled():
    circle = Profile.circle(2.0)
    # Positive y is to the left, and arc length grows from the floor towards the left.
    arcs_m = circle.arc_m([0.0, 2.0, 0.0, -2.0], [0.0, 2.0, 4.0, 2.0])
    assert arcs_m.dtype == "float64"
    assert list(arcs_m) == pytest.approx([0.0, math.pi, math.tau, 1.5 * math.tau])
    assert circle.point_at_m(math.pi) == pytest.approx((2.0, 2.0))
    with pytest.raises(ValueError, match="y_m has 1 values and z_m has 2"):
        circle.arc_m([0.0], [0.0, 1.0])
    assert Profile.rectangle(2.0, 3.0).perimeter_m == pytest.approx(10)
    assert Profile.ceran().perimeter_m == pytest.approx(35.90, abs=0.005)
    assert Profile.arch(4.0, 5.0, 2.0).perimeter_m == pytest.approx(4 + 2 * 3 + math.tau)
    assert Profile.trimmed_circle(6.05, 10.4).perimeter_m == Profile.ceran().perimeter_m


def test_arguments_out_of_range_are_refused_by_name():
    with pytest.raises(headrace.SamplingError, match="doesn't divide a turn"):
        Turn(math.radians(0.7), 8.0)
    with pytest.raises(ValueError, match="speed in m/s is -1"):
        Spiral(-1.0, Turn(math.radians(0.9), 8.0), 1.0)
    with pytest.raises(headrace.SamplingError, match="never meets the flat wall"):
        sampling.t_y2_m(3.0, math.radians(0.9), 101)
    with pytest.raises(headrace.SamplingError, match="outside the tunnel"):
        Profile.circle(1.0).t_y_at_rest_m(5.0, 5.0, Turn(math.radians(0.9), 8.0))
    with pytest.raises(headrace.SamplingError, match="making a tunnel's profile"):
        Profile.rectangle(0.0, 3.0)


@pytest.mark.parametrize(
    "asked",
    [{}, {"target_m": 0.4}, {"speed_mps": 0.15}, {"time_s": 7200.0}, {"drift_m": 0.2, "yaw_rad": math.radians(3)}],
)
def test_plan_equals_that_of_the_program(program, golden, asked):
    vehicle = golden / "two-heads.toml"
    names = {"target_m": "--target", "speed_mps": "--speed", "drift_m": "--drift"}
    options = [word for key, name in names.items() if key in asked for word in (name, repr(asked[key]))]
    if "time_s" in asked:
        options += ["--hours", repr(asked["time_s"] / 3600)]
    if "yaw_rad" in asked:
        options += ["--yaw", "3"]
    command = [program, "plan", "--vehicle", vehicle, "--json", *options]
    theirs = json.loads(subprocess.run(command, capture_output=True).stdout)["modes"]
    ours = sampling.plan(vehicle, **asked)
    assert ours == theirs
    assert len(ours) == 5 and sum(answer["best"] for answer in ours) == 1
    assert set(ours[0]) == set(sampling.Answer.__annotations__)
    best = next(answer for answer in ours if answer["best"])
    assert set(best["spacing"]) == set(sampling.Spacing.__annotations__)
    assert set(best["margins"]) == set(sampling.Margins.__annotations__)


def test_wrong_vehicle_file_raises_an_error_with_file_and_line(golden, tmp_path):
    text = (golden / "two-heads.toml").read_text()
    wrong = tmp_path / "wrong.toml"
    wrong.write_text(text.replace("target_m", "target_mm"))
    with pytest.raises(headrace.ConfigError, match="target_mm") as caught:
        sampling.plan(wrong)
    assert caught.value.file == str(wrong) and caught.value.place.startswith("line ")
    with pytest.raises(headrace.ConfigError, match="reading") as caught:
        Profile.of_vehicle(tmp_path / "none.toml")
    assert caught.value.file == str(tmp_path / "none.toml")
    assert Profile.of_vehicle(golden / "two-heads.toml").perimeter_m > 0
