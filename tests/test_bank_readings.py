"""Names and texts of the earlier form read by rule, against closed forms; wrong values have to fail."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from filippov.app.bank import run_bank

PUSHED: dict[str, Any] = {
    "states": ["x", "v"], "params": {"a": "2"}, "h": ["v"], "fields": {"+": ["v", "-a"], "-": ["v", "a"]},
    "x0": ["1", "3"], "t_span": ["0", "2"],
}  # fmt: skip
RAMP: dict[str, Any] = {
    "states": ["x"], "h": ["x-t/2"], "fields": {"+": ["-1"], "-": ["1"]}, "x0": ["1"], "t_span": ["0", "2"],
}  # fmt: skip
LATE: dict[str, Any] = {
    "states": ["x"], "h": ["x"], "fields": {"+": ["t-1"], "-": ["1-t"]}, "x0": ["1/8"], "t_span": ["0", "3"],
}  # fmt: skip
# Super-twisting: in sqrt|x| and 2 sqrt|x| as time it is linear, with damping a/2 and frequency w.
A, B = 1.5, 1.1
Q = math.exp(-A * math.pi / (2 * math.sqrt(2 * B - A * A / 4)))
TWISTED: dict[str, Any] = {
    "states": ["x", "y"], "h": ["x"], "x0": ["0", "1"], "t_span": ["0", "5"],
    "fields": {"+": ["-3*sqrt(Abs(x))/2+y", "-11/10"], "-": ["3*sqrt(Abs(x))/2+y", "11/10"]},
}  # fmt: skip
BELT: dict[str, Any] = {
    "states": ["x", "v"], "h": ["v-v0"], "x0": ["0", "0"], "t_span": ["0", "200"],
    "params": {"mu": "0.2", "z": "0.1", "w": "0.7", "v0": "0.8", "a": "0.5"},
    "fields": {"+": ["v", "-x-2*z*v+a*cos(w*t)-mu"], "-": ["v", "-x-2*z*v+a*cos(w*t)+mu"]},
}  # fmt: skip
BUCK: dict[str, Any] = {
    "states": ["i", "v"], "h": ["v-12+(i-v/10)/4"], "x0": ["0", "0"], "t_span": ["0", "8"],
    "fields": {"+": ["-v", "i-v/10"], "-": ["36-v", "i-v/10"]},
}  # fmt: skip
POLE: dict[str, Any] = {
    "states": ["x"], "h": ["x-1"], "fields": {"+": ["1+x**2"], "-": ["1"]}, "x0": ["0"], "t_span": ["0", "4"],
}  # fmt: skip
QUARTIC: dict[str, Any] = {"polynomial": ["1", "6", "11", "6", "K"]}
FOUND: list[tuple[dict[str, Any], str, Any]] = [
    (PUSHED, "stopping_time", 1.5), (PUSHED, "stopping_distance", 2.25), (PUSHED, "t_max_x", 1.5),
    (RAMP, "x_hit", 1 / 3), (RAMP, "x_at_first_slide", 1 / 3), (RAMP, "first_switch_time", 2 / 3),
    (RAMP, "weight_plus", 0.25), (RAMP, "weight_minus", 0.75), (RAMP, "x_range", [1 / 3, 1]),
    (RAMP, "number_of_solutions", 1), (LATE, "t_non_unique", 1), (LATE, "end_states", [[-2], [0], [2]]),
    (TWISTED, "contraction_per_half_turn", Q), (TWISTED, "accumulation_time", (1 + Q) / (B * (1 - Q))),
    (TWISTED, "y_at_first_crossing", -Q), (BUCK, "duty_cycle", 1 / 3),
    (BELT, "grazing_amplitude", 0.8 * math.sqrt(0.51**2 + 0.14**2) / 0.7), (QUARTIC, "omega_at_K=10", 1),
]  # fmt: skip


@pytest.mark.parametrize(("problem", "name", "value"), FOUND, ids=[row[1] for row in FOUND])
def test_names(problem: dict[str, Any], name: str, value: Any) -> None:
    def run(given: Any) -> Any:
        entry = {"name": name, "value": given, "tol": "1e-6"}
        return run_bank([{"id": "case", **problem, "expected": [entry]}])[0]

    def off(given: Any) -> Any:
        return [off(item) for item in given] if isinstance(given, list) else 1.0123 * given + 0.0123

    row = run(value)
    assert row.passed, row.message
    assert row.not_evaluated == ()
    assert not run(off(value)).passed


def test_finite_escape() -> None:
    entry = {"name": "must_report", "value": "finite escape before t=4", "tol": "0"}
    assert run_bank([{"id": "pole", **POLE, "expected": [entry]}])[0].passed
    assert not run_bank([{"id": "ramp", **RAMP, "expected": [entry]}])[0].passed


def switches(levels: tuple[float, float], x: float, up: bool) -> list[float]:
    """The first times at which x' = 1-x (up) and x' = -1-x switch, at the upper and the lower level."""
    t, found = 0.0, []
    while len(found) < 4:
        to, level = (1.0, levels[0]) if up else (-1.0, levels[1])
        if (x - level) * to < 0:
            t, x = t + math.log((to - x) / (to - level)), level
            found.append(t)
        up = not up
    return found


def test_automata_begin_in_their_first_mode() -> None:
    draw = np.random.default_rng(3)
    for _ in range(25):
        levels = draw.uniform(0.05, 0.9), -draw.uniform(0.05, 0.9)
        middle = 0.5 * (levels[0] + levels[1])
        half = 0.5 * (levels[0] - levels[1])
        x = float(draw.choice([middle, middle + 0.78 * half * draw.uniform(-1, 1), middle - 0.78 * half]))
        times = switches(levels, x, up := bool(draw.random() < 0.5))
        texts = [f"up: x'=-x+1 until x={levels[0]!r}", f"down: x'=-x-1 until x={levels[1]!r}"]
        first, second = texts if up else texts[::-1]
        for text in (f"{first}; {second}", f"{second}; {first}; starts in {first.partition(':')[0]}"):
            entry = {"name": "switch_times", "value": times, "tol": "1e-9"}
            case = {"id": "relay", "states": ["x"], "x0": [x], "t_span": [0, 1.001 * times[-1]]}
            (row,) = run_bank([{**case, "hybrid": text, "expected": [entry]}])
            assert row.passed, (text, x, row.message)


def test_an_automaton_that_begins_near_the_threshold_of_its_mode_is_refused() -> None:
    text = "up: x'=-x+1 until x=0.5; down: x'=-x-1 until x=-0.5"
    case = {"id": "relay", "states": ["x"], "x0": ["0.499"], "t_span": ["0", "1"], "hybrid": text}
    (row,) = run_bank([{**case, "expected": [{"name": "x_at_1", "value": "0", "tol": "1e-9"}]}])
    assert not row.passed
    assert "begins near to the threshold" in row.message
