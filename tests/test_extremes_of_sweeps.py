"""Extremes of a state over the tail of a run: tops between the samples of steps, wherever steps end."""

import math
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

from filippov import Problem, Sweep, System, parameters, states

x, v = states("x v")
p = parameters(w=1.0, c=0.0)


@pytest.mark.parametrize("rtol", [1e-8, 1e-10, 1e-12])
def test_extremes_of_a_decaying_oscillation(tmp_path: Path, rtol: float) -> None:
    """x = exp(-c t) cos w t over the last half of 20: at its tops, tan w t = -c/w, or at the ends."""
    system = System({x: v, v: -2 * p.c * v - (p.w**2 + p.c**2) * x}, parameters=p, outputs={"twice": 2 * x})
    over = {"w": np.linspace(0.7, 2.3, 9), "c": [0.0, 0.03]}
    names = ["max(x)", "min(x)", "amplitude(x)", "max(twice)", "end(x)"]
    for c in over["c"]:
        chosen = Sweep(
            Problem(system, (1.0, -c), (0, 20)), {"w": over["w"], "c": [c]}, measure=names, rtol=rtol,
            atol=1e-2 * rtol,
        )  # fmt: skip
        with ThreadPoolExecutor(1) as pool:
            table = chosen.run(tmp_path / f"{c}", executor=pool)
        for k, w in enumerate(over["w"]):
            tops = (np.arange(-2, 40) * math.pi - math.atan(c / w)) / w
            times = np.concatenate([tops[(tops > 10) & (tops < 20)], [10.0, 20.0]])
            values = np.exp(-c * times) * np.cos(w * times)
            low, high = values.min(), values.max()
            assert table["end(x)"][k] == pytest.approx(values[-1], abs=1e3 * rtol)
            wanted = {"max(x)": high, "min(x)": low, "amplitude(x)": (high - low) / 2, "max(twice)": 2 * high}
            for name, value in wanted.items():
                assert table[name][k] == pytest.approx(value, abs=1e3 * rtol + 1e-11), (name, w)
