"""Programs f(t, y) in other words: what the doctor finds in idioms, matrices, rings and clocks."""

import math
from pathlib import Path

import naive_programs as programs
import pytest

from filippov.analysis import diagnose

OTHER_WORDS = [
    "difference_of_conditions", "idiom", "walrus", "written_in_place", "matrix_form", "with_cache", "guarded",
]  # fmt: skip


@pytest.mark.parametrize("name", OTHER_WORDS)
def test_15_5_dry_friction_is_found_however_it_is_written(name: str) -> None:
    """x'' = -x - 0.3 sgn(x') from (1, 0) turns at -0.4 and stays at -0.2, half a period after that."""
    found = diagnose(getattr(programs, name), (1, 0), (0, 8), max_calls=3000)
    assert found.solution is not None, str(found)
    assert Path(found.file).name == "naive_programs.py"
    (switch,) = found.switches
    assert (switch.kind, switch.slides) == ("jump", True)
    assert switch.lines
    assert [event.t for event in found.solution.events] == pytest.approx([math.pi, 2 * math.pi], abs=1e-9)
    assert found.solution.x_end == pytest.approx([-0.2, 0], abs=1e-9)
    assert {"hang", "chattering"} & {finding.kind for finding in found.findings}


def test_15_5_rings_lockdowns_and_dampers() -> None:
    ring = diagnose(programs.ring, (1, -1, 0, 0), (0, 3), max_calls=3000)
    assert ring.solution is not None
    assert ring.solution.sol(math.pi / 2) == pytest.approx([-0.85, 0.85, 0, 0], abs=1e-8)
    away = diagnose(programs.lockdown, (0.9, 0.01), (0, 30), max_calls=3000)
    assert away.solution is not None
    (entry,) = away.solution.events.of(kind="sliding entry")
    assert away.solution.sol(20.0) == pytest.approx([entry.x[0] - 0.01 * (20 - entry.t), 0.05], abs=1e-9)
    # A condition on a depth that is 0 off the contact is one of the place: nothing slides where it is 0.
    contact = diagnose(programs.damped_contact, (1, 0), (0, 2), max_calls=3000)
    assert contact.solution is not None
    assert contact.solution.success
    assert [(switch.kind, switch.slides) for switch in contact.switches] == [("jump", False)]
    first = math.sqrt(2 / 9.81)
    assert contact.solution.events[0].t == pytest.approx(first, abs=1e-9)
    assert not contact.of("chattering")


def test_15_5_a_clock_is_said_once() -> None:
    wave = diagnose(programs.square_wave, (0,), (0, 1))
    assert len(wave.of("clock")) == 1
    assert wave.solution is not None
    half = 1 - math.exp(-0.5)
    assert wave.solution.x_end[0] == pytest.approx((half + 1) * math.exp(-0.5) - 1, abs=1e-9)


def test_15_5_a_program_that_writes_into_the_array_of_the_integrator_is_told_so() -> None:
    fires = diagnose(programs.fires_in_place, (0,), (0, 5))
    (finding,) = fires.of("writes into y")
    text_of_programs = Path(programs.__file__).read_text(encoding="utf-8").splitlines()
    line = next(i for i, text in enumerate(text_of_programs, 1) if text == "        y[0] = 0.0")
    assert f"line {line} `y[0] = 0.0` writes into y" in finding.sentence
    assert "reset=" in finding.sentence
    assert not diagnose(programs.written_in_place, (1, 0), (0, 2)).of("writes into y")


def test_15_5_a_direction_without_a_value_is_no_smooth_program() -> None:
    """v' = -0.3 v/|v| in the plane stops at t = |v|/0.3; no sign of one surface says so."""
    found = diagnose(programs.planar_friction, (0, 0, 0.3, 0.4), (0, 5), max_calls=3000)
    reached = found.of("hang")[0].t
    assert reached is not None
    assert 0.5 / 0.3 - 0.05 < reached < 5
    (finding,) = found.of("singular")
    assert "v1**2 + v2**2" in finding.sentence
    assert "the sign of one speed" in finding.sentence
    assert "an integrator of smooth equations" not in str(found)
