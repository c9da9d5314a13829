"""A time span that falls is refused unless it is said to be meant: it may be a state in scipy's place."""

import json
import pickle

import numpy as np
import pytest

from filippov import Problem, Sweep, System, sign, solve, solve_many, states
from filippov.base.errors import UsageError

x, v, z = states("x v z")
OSCILLATOR = System({x: v, v: -x - 0.1 * sign(v)})
THREE = System({x: v, v: -x - 0.1 * sign(v), z: x})
ONE = System({x: -sign(x)})
BOTH = r"\(1\.1, 0\.0\).*backwards.*backward=True.*scipy.*x0=\(1\.1, 0\.0\), t_span=\(0, 12\)"


@pytest.mark.parametrize("call", [solve, Problem])
def test_11_10_the_order_of_scipy_is_refused_with_both_readings(call):
    """solve_ivp(f, t_span, x0): with two states both orders fit."""
    with pytest.raises(UsageError, match=BOTH):
        call(OSCILLATOR, (0, 12), (1.1, 0))
    with pytest.raises(UsageError, match=BOTH):
        call(OSCILLATOR, t_span=(1.1, 0), x0=np.array([0, 12]))


@pytest.mark.parametrize(("system", "state"), [(THREE, (1.1, 0, 0)), (ONE, (1.1,)), (ONE, 1.1)])
def test_11_10_where_the_lengths_tell_the_exchange_is_named(system, state):
    """Not two states: one reading only is possible, whether the span would rise or fall."""
    for span in ((0, 12), (12, 0)):
        with pytest.raises(UsageError, match=r"they look exchanged.*x0 goes first"):
            solve(system, span, state)


def test_11_10_backwards_where_it_is_said():
    """With closed form: x = 1.1 cos t - 0.1 (cos t - 1) from rest, friction 0.1 against v < 0."""
    there = solve(OSCILLATOR, (1.1, 0), (0, 2), rtol=1e-12)
    back = solve(OSCILLATOR, there.x_end, (2, 0.1), backward=True, rtol=1e-12)
    assert back.x_end[0] == pytest.approx(np.cos(0.1) + 0.1, abs=1e-11)
    problem = Problem(OSCILLATOR, there.x_end, (2, 0.1), backward=True)
    assert problem.backward
    assert np.array_equal(solve(problem).x_end, solve(pickle.loads(pickle.dumps(problem))).x_end)  # noqa: S301
    many = solve_many(OSCILLATOR, [there.x_end] * 3, (2, 0.1), backward=True, rtol=1e-12)
    assert np.allclose(many.x, back.x_end, atol=1e-11)
    table = Sweep(problem, {"x0.x": [there.x_end[0]]}, measure="end(x)", rtol=1e-12).run()
    assert table["end(x)"][0] == pytest.approx(back.x_end[0], abs=1e-11)


def test_11_10_every_entry_has_the_same_rule():
    """A fall without the word and the word without a fall are refused; a remake keeps the direction."""
    forwards = Problem(OSCILLATOR, (1, 0), (0, 2))
    back = Problem(OSCILLATOR, (1, 0), (2, 0), backward=True)
    for call in (
        lambda: solve_many(OSCILLATOR, [(1, 0)], (2, 0)),
        lambda: forwards.remake(t_span=(2, 0)),
        lambda: solve(forwards, t_span=(2, 0)),
        lambda: solve(OSCILLATOR, x0=(1, 0), t_span=(2, 0)),
    ):
        with pytest.raises(UsageError, match="backward=True"):
            call()
    for call in (
        lambda: solve(OSCILLATOR, (1, 0), (0, 2), backward=True),
        lambda: solve(forwards, backward=True),
        lambda: solve_many(OSCILLATOR, [(1, 0)], (0, 2), backward=True),
    ):
        with pytest.raises(UsageError, match="backward is True, but t_span"):
            call()
    with pytest.raises(UsageError, match="backward is 'yes', expected True or False"):
        solve(OSCILLATOR, (1, 0), (2, 0), backward="yes")
    assert back.remake(x0=(2, 0)).backward
    assert back.remake(t_span=(3, 1)).backward
    assert not back.remake(t_span=(0, 1)).backward
    assert forwards.remake(t_span=(2, 0), backward=True).backward
    assert solve(forwards, t_span=(2, 0), backward=True).t_end == 0


def test_11_10_the_command_says_it_with_a_flag(tmp_path, capsys):
    """--t-span 2 0 alone is refused."""
    from filippov.app.cli.main import main

    model = tmp_path / "own.py"
    text = "from filippov import System, states\nx, v = states('x v')\nosc = System({x: v, v: -x})\n"
    model.write_text(text)
    arguments = ["simulate", f"{model}:osc", "--x0", "1,0", "--t-span", "2", "0"]
    assert main(arguments) == 2
    assert "--t-span 2 0 runs backwards in time: add --backward" in capsys.readouterr().err
    assert main([*arguments, "--backward"]) == 0


@pytest.mark.parametrize("words", ["simulate", "sweep --over x0.x=1:2:2", "ensemble --over x0.x=1:2:2"])
def test_a_command_says_that_it_ran_backwards(words, tmp_path, capsys):
    """And its summary does; without the flag it says how to ask for it."""
    from filippov.app.cli.main import main

    model = tmp_path / "own.py"
    text = "from filippov import System, states\nx, v = states('x v')\nosc = System({x: v, v: -x})\n"
    model.write_text(text)
    name, *rest = words.split()
    asked = [name, f"{model}:osc", *rest, "--x0", "1,0", "-o", str(tmp_path / "out"), "--t-span"]
    assert main([*asked, "2", "0"]) == 2
    assert "runs backwards in time: add --backward or exchange the two" in capsys.readouterr().err
    assert main([*asked, "0", "2", "--backward"]) == 2
    assert "runs forwards in time: drop --backward or exchange the two" in capsys.readouterr().err
    assert main([*asked, "2", "0", "--backward"]) == 0
    assert "backwards in time, from t = 2 to t = 0" in capsys.readouterr().err
    assert json.loads((tmp_path / "out" / "summary.json").read_text())["backward"] is True


def test_16_1_minus_one_is_backward() -> None:
    """The sense of time as a number, as the flag."""
    x, v = states("x v")
    swing = System({x: v, v: -x})
    ends = [solve(swing, (1, 0), (2, 0), backward=sense).x_end for sense in (True, -1)]
    assert ends[0].tolist() == ends[1].tolist()
    with pytest.raises(UsageError):
        solve(swing, (1, 0), (2, 0), backward=1)
