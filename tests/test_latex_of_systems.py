"""LaTeX of a System: every rule is in it, names are indices and not products, and it compiles."""

import re

import pytest
from matplotlib.mathtext import MathTextParser

from filippov import Parameter, Piecewise, Surface, System, TimeEvent, parameters, sign, states
from filippov.io.notebook import symbol
from filippov.models import get, names

x, v, u_max = states("x v u_max")
p = parameters(e=0.8, Fs=Parameter(1.5, "N"), v_max=2.0, w=0.1, tau=1.0)
BALL = System(
    {x: v, v: -p.Fs - p.tau * sign(u_max - 1), u_max: v - u_max - sign(v - 1)},
    surfaces=[
        Surface("floor_1", x, reset={v: -p.e * v, u_max: u_max + x}), Surface("thermostat", v - 1, width=p.w),
        Surface("ceiling", x - 3, reset={v: -v / 4}, side="both"),
    ],
    time_events=[
        TimeEvent("dose", period=p.tau, start=2 * p.w, reset={u_max: u_max + p.v_max}),
        TimeEvent("kicks", times=(1.0, 2.5), reset={v: v + 1}), TimeEvent("sample", period=2.0),
    ],
    outputs={"power_in": p.Fs * v * sign(v)}, parameters=p,
)  # fmt: skip
FUNCTIONS = System(
    field=lambda t, x, p, s: [x[1], -s[0]], states="x v_1", parameters={"k": 1.0},
    surfaces=[
        Surface("v", lambda t, x, p: x[1]),
        Surface("wall", lambda t, x, p: x[0] - 1, reset=lambda t, x, p: [x[0], -x[1]], side="-"),
    ],
    time_events=[TimeEvent("tick", period=lambda p: p["k"], reset=lambda t, x, p: x)],
)  # fmt: skip


@pytest.mark.parametrize(
    "part",
    [
        r"\text{floor\_1: }& x = 0 \;\text{(reset)},\; v \to - e v,\; u_{\mathrm{max}} \to ",
        r"\text{thermostat: }& v - 1 = 0 \;\text{(switching)},\; \text{hysteresis } \pm w",
        r"\text{ceiling: }& x - 3 = 0 \;\text{(reset)},\; \text{from both},\; v \to - \frac{v}{4}",
        r"\text{dose: }& t \in \{2 w + k\, \tau\},\; u_{\mathrm{max}} \to ",
        r"\text{kicks: }& t \in \{1, 2.5\},\; v \to v + 1",
        r"\text{sample: }& t \in \{k\, 2\}", r"\text{power\_in} &= \mathrm{Fs} v \operatorname{sign}",
        r"\dot{u_{\mathrm{max}}} &=", r"\mathrm{Fs} &= 1.5\;\text{N}", r"v_{\mathrm{max}} &= 2",
    ],
)  # fmt: skip
def test_every_rule_is_shown(part: str) -> None:
    assert part in BALL._repr_latex_()


def test_functions_are_named() -> None:
    text = FUNCTIONS._repr_latex_()
    assert r"\text{v: }& h(t, x, p) = 0 \;\text{(switching)}" in text
    assert r"\text{wall: }& h(t, x, p) = 0 \;\text{(reset)},\; x \to r(t, x, p)" in text
    assert r"\text{tick: }& t \in" in text


@pytest.mark.parametrize(
    ("name", "shown"),
    [
        ("x", "x"), ("Fs", r"\mathrm{Fs}"), ("v_max", r"v_{\mathrm{max}}"), ("x1", "x_{1}"),
        ("x_1_a", r"x_{1,\mathrm{a}}"),
        ("beta", r"\beta"), ("mu_k", r"\mu_{\mathrm{k}}"), ("xdot", r"\mathrm{xdot}"),
        ("_a", r"\mathrm{\_a}"), ("k_", r"\mathrm{k\_}"), ("Fs2", r"\mathrm{Fs}_{2}"),
        ("hat", r"\mathrm{hat}"),
    ],
)  # fmt: skip
def test_a_name_is_no_product(name: str, shown: str) -> None:
    assert symbol(name) == shown
    MathTextParser("agg").parse(f"${shown}$")


def compiles(text: str) -> int:
    """The lines of the equations that matplotlib's mathtext reads, all that have no cases."""
    inner = re.fullmatch(r"\$\$\\begin\{aligned\}\n(.*)\n\\end\{aligned\}\$\$", text, re.DOTALL)
    assert inner is not None
    read = 0
    for line in inner[1].split(" \\\\\n"):
        if r"\begin{cases}" not in line:
            assert line.count("&") <= 1
            MathTextParser("agg").parse("$" + line.replace("&", "") + "$")
            read += 1
    return read


@pytest.mark.parametrize("name", [*names(), "ball", "functions"])
def test_it_compiles(name: str) -> None:
    system = {"ball": BALL, "functions": FUNCTIONS}.get(name) or get(name).build()
    assert compiles(system._repr_latex_()) > 0


@pytest.mark.parametrize(
    ("unit", "shown"),
    [
        ("N/m", r"\text{N/m}"), ("m/s^2", r"\mathrm{m/s^{2}}"), ("%", r"\text{\%}"),
        ("N*s", r"\mathrm{N\cdot s}"),
        ("kg*m**-2", r"\mathrm{kg\cdot m^{-2}}"),
    ],
)  # fmt: skip
def test_units(unit: str, shown: str) -> None:
    text = System({x: -parameters(k=Parameter(1.0, unit)).k * x})._repr_latex_()
    assert rf"k &= 1\;{shown}" in text
    assert compiles(text) == 2


def test_branches_are_cases() -> None:
    shown = System({x: Piecewise((1, x > 0), (-x, True))})._repr_latex_()
    assert r"\begin{cases}" in shown
