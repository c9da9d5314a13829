"""Systems from other descriptions (issue 16, item 9): state space, python-control, quantities with units."""

import numpy as np
import pytest
import sympy
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from filippov import (
    Input,
    ModelError,
    Parameter,
    Surface,
    System,
    UsageError,
    parameters,
    sign,
    sin,
    solve,
    solve_many,
    states,
    t,
)
from filippov.analysis import linear_mode
from filippov.interop import (
    backlash,
    dead_zone,
    from_control,
    from_statespace,
    quantiser,
    relay,
    sample_and_hold,
    sampled,
    saturation,
)
from filippov.interop import friction as friction_block

control = pytest.importorskip("control")
x, v = states("x v")
A, B, C = [[0.0, 1.0], [-2.0, -0.3]], [0.0, 1.0], [1.0, 0.5]


def closed(block, plant=None, r=1.0) -> System:
    """The plant 1/(s (s + 1)), or another, in a loop with a block on the error."""
    plant = control.ss([[-1, 0], [1, 0]], [[1], [0]], [[0, 1]], 0) if plant is None else plant
    plant = control.ss(plant, name="plant", inputs="u", outputs="y")
    junction = control.summing_junction(inputs=["r", "-y"], output="e")
    loop = control.interconnect([plant, block, junction], inputs="r", outputs=["y", "u", "e"])
    return from_control(loop, {"r": r})


def test_16_9_a_plant_with_a_relay_is_its_equations() -> None:
    p = parameters(k=2.0)
    y = sympy.Symbol("y", real=True)
    made = from_statespace(
        A, B, C, nonlinearity=lambda y: -p.k * sign(y), states="x v", surfaces=[Surface("relay", y)]
    )
    written = System({x: v, v: -2 * x - 0.3 * v - p.k * sign(x + 0.5 * v)})
    assert made.surface_names == ("relay",)
    run = solve(made, (1.0, 0.0), (0, 6))
    assert run.x_end == pytest.approx(solve(written, (1.0, 0.0), (0, 6)).x_end, abs=1e-10)
    assert run["y"] == pytest.approx(run["x"] + 0.5 * run["v"], abs=1e-14)
    # Two inputs and outputs; y2 = u1 + ... has feed-through, but does not act on u1.
    a, d = np.array([[-1.0, 0.5], [0.0, -2.0]]), [[0, 0], [3, 0]]
    both = from_statespace(a, np.eye(2), np.eye(2), d, nonlinearity=lambda y1, y2: (0.5 * y1, -y2 - 1))
    matrix = a + np.array([[0.5, 0.0], [-1.5, -1.0]])
    rest = np.linalg.solve(matrix, [0.0, 1.0])
    exact = rest + expm(2.0 * matrix) @ ([0.3, 0.4] - rest)
    assert solve(both, (0.3, 0.4), (0, 2)).x_end == pytest.approx(exact, abs=1e-10)


def test_16_9_saturation_and_dead_zone_agree_with_an_integration_of_formulas() -> None:
    for block, law in (
        (saturation("e", "u", -0.4, 0.2), lambda e: np.clip(e, -0.4, 0.2)),
        (dead_zone("e", "u", 0.3), lambda e: np.sign(e) * max(abs(e) - 0.3, 0.0)),
    ):
        run = solve(closed(block), (0, 0), (0, 8))
        other = solve_ivp(
            lambda t, z, law=law: [-z[0] + law(1 - z[1]), z[0]], (0, 8), (0, 0), method="DOP853", rtol=1e-10,
            atol=1e-12, max_step=0.01,
        )  # fmt: skip
        assert run.x_end == pytest.approx(other.y[:, -1], abs=1e-8)
        # python-control evaluates the same block.
        assert float(block.outfcn(0, [], [0.7], {})[0]) == pytest.approx(law(0.7))


def test_16_9_a_relay_with_hysteresis_has_the_period_of_its_triangle() -> None:
    """x' = 2 sgn(-x) with the half-width 0.1: a triangle between -0.1 and 0.1, of period 4*0.1/2."""
    integrator = control.ss([[0]], [[1]], [[1]], 0)
    run = solve(closed(relay("e", "u", 2.0, width=0.1), integrator, r=0), (0.0,), (0, 2))
    assert np.diff(run.events.of("relay").t) == pytest.approx(np.full(len(run.events) - 1, 0.1), rel=1e-9)


def test_16_9_sampled_blocks_are_the_recursion_of_their_matrices() -> None:
    """The plant between samples is its zero-order hold (control.c2d), so the loop is a recursion."""
    period = 0.1
    plant = control.ss([[-1, 0], [1, 0]], [[1], [0]], [[0, 1]], 0)
    held = control.c2d(plant, period)
    controller = control.ss([[0.5]], [[1.0]], [[-0.4]], [[1.2]], period)
    state, inner, u = np.zeros(2), np.zeros(1), 0.0
    for _ in range(30):
        state = held.A @ state + held.B[:, 0] * u
        e = 1.0 - state[1]
        u = float((controller.C @ inner)[0] + controller.D[0, 0] * e)
        inner = controller.A @ inner + controller.B[:, 0] * e
    run = solve(closed(sampled(controller, "e", "u")), np.zeros(4), (0, 3.0))
    assert run.x_end == pytest.approx([*state, *inner, u], abs=1e-10)
    state, u = np.zeros(2), 0.0
    for _ in range(30):
        state = held.A @ state + held.B[:, 0] * u
        u = 1.0 - state[1]
    run = solve(closed(sample_and_hold("e", "u", period)), np.zeros(3), (0, 3.0))
    assert run.x_end == pytest.approx([*state, u], abs=1e-10)


def test_16_9_backlash_is_the_play_of_its_input() -> None:
    """z = min(max(z, u - w), u + w) along a fine sampling of u = sin t + sin(2.3 t)/2."""
    gear = control.interconnect([backlash("a", "b", 0.4)], inputs="a", outputs="b")
    run = solve(from_control(gear, {"a": sin(t) + sin(2.3 * t) / 2}), (0.0,), (0, 12))
    fine = np.linspace(0, 12, 120_001)
    u = np.sin(fine) + np.sin(2.3 * fine) / 2
    z = np.zeros(fine.size)
    for k in range(1, fine.size):
        z[k] = min(max(z[k - 1], u[k] - 0.4), u[k] + 0.4)
    assert run.sol(fine[::100])[0] == pytest.approx(z[::100], abs=1e-7)


def test_16_9_quantiser_friction_and_functions_of_numpy() -> None:
    steps = control.interconnect(
        [quantiser("a", "b", 0.5, 1), control.ss([[0]], [[1]], [[1]], 0, inputs="b", outputs="c")],
        inputs="a", outputs=["b", "c"],
    )  # fmt: skip
    run = solve(from_control(steps, {"a": 0.3 * t}), (0.0,), (0, 10))
    assert run.events.t == pytest.approx([0.25 / 0.3])
    assert run.x_end == pytest.approx([0.5 * (10 - 0.25 / 0.3)])
    finer = quantiser("a", "b", 0.5, 3)
    values = [float(finer.outfcn(0, [], [u], {})[0]) for u in (-9, -0.3, 0.1, 0.8, 1.2)]
    assert values == [-1.5, -0.5, 0, 1, 1]
    # A block on a slope of 0.8 under Coulomb friction 0.5, stiction 1: it rests until pushed beyond.
    mass = control.ss([[0]], [[1]], [[1]], 0, name="mass", inputs="F", outputs="w")
    drag = friction_block("w", "f", 0.5, static=1.0)
    load = control.summing_junction(inputs=["push", "-f"], output="F")
    slope = from_control(control.interconnect([mass, drag, load], inputs="push", outputs="w"), {"push": 0.8})
    assert solve(slope, (0.0,), (0, 2)).x_end == pytest.approx([0.0], abs=1e-14)
    assert solve(slope, (0.1,), (0, 2)).x_end == pytest.approx([0.1 + 0.3 * 2])
    pendulum = control.nlsys(
        lambda t, x, u, p: [x[1], -p["g"] * np.sin(x[0]) + u[0]], None, inputs="tau", states=["th", "w"],
        outputs=["th", "w"], name="pendulum", params={"g": 9.81},
    )  # fmt: skip
    swing = from_control(pendulum, {"tau": 0.0})
    run = solve(swing, (0.5, 0.0), (0, 3))
    energy = run["w"] ** 2 / 2 - 9.81 * np.cos(run["th"])
    assert energy == pytest.approx(np.full(energy.size, -9.81 * np.cos(0.5)), abs=1e-8)


def test_16_9_what_has_no_meaning_is_refused() -> None:
    plant = control.ss([[-1]], [[1]], [[1]], [[1]], name="plant", inputs="u", outputs="y")
    for make, text in (
        (lambda: closed(relay("e", "u"), plant), "an algebraic loop"),
        (lambda: from_statespace([[0]], [1], [1], 1, nonlinearity=lambda y: -sign(y)), "an algebraic loop"),
        (lambda: from_statespace(A, [1], C, nonlinearity=sign), r"B has shape \(1, 1\)"),
        (lambda: from_statespace(A, B, C, nonlinearity=lambda y: (y, y)), "returned 2 values, expected 1"),
        (lambda: from_control(plant), "nothing is given for the input 'u'"),
        (lambda: from_control(plant, {"U": 1}), "did you mean 'u'"),
        (lambda: from_control(3), "expected a system of python-control"),
        (lambda: from_control(control.ss([[1]], [[1]], [[1]], 0, 0.1), {"u[0]": 0}), "is sampled"),
        (lambda: relay("e", "u", -1), "amplitude is -1"),
        (lambda: quantiser("e", "u", 0.1, 99), "from 1 to 32"),
        (lambda: sampled(plant, "e", "u"), "expected a sampled system"),
        (lambda: sampled([[1]], "e", "u"), "expected a sampled StateSpace or TransferFunction"),
        (lambda: relay("e", 1.0), "outputs is 1.0, expected the name of one signal"),
        (lambda: backlash(None, "b"), "inputs is None, expected the name of one signal"),
    ):
        with pytest.raises(ModelError, match=text):
            make()
    choosing = control.nlsys(
        lambda t, x, u, p: [1.0 if x[0] > 0 else -1.0], None, states=["a"], outputs=1, inputs=0
    )
    with pytest.raises(ModelError, match="does not take symbols"):
        from_control(choosing)


def test_16_9_a_mode_is_linearised_for_python_control() -> None:
    """On x = 0 of x' = v - 2 sgn(x), v' = -v + sgn(x) - k v^3 the sign is v/2: v' = -v/2 - k v^3."""
    p = parameters(k=0.7)
    system = System({x: v - 2 * sign(x), v: -v + sign(x) - p.k * v**3}, outputs={"push": 3 * sign(x) + v})
    free = linear_mode(system, "+", (1.0, 0.5), outputs=["x", "push"], inputs=["k"])
    slope = -1 - 3 * 0.7 * 0.25
    assert pytest.approx(np.array([[0, 1], [0, slope]])) == free.A
    assert pytest.approx(np.array([[0], [-0.125]])) == free.B
    assert pytest.approx(np.array([[1, 0], [0, 1]])) == free.C
    slides = linear_mode(system, "0", {"x": 0.0, "v": 0.5}, outputs=["push"])
    assert slides.input_labels == ["k"]
    assert slides.A[1, 1] == pytest.approx(slope + 0.5)
    assert slides.A[0] == pytest.approx([0.0, 0.0])
    assert pytest.approx(np.array([[0, 2.5]])) == slides.C
    with pytest.raises(UsageError, match="unknown output 'pusch'; did you mean 'push'"):
        linear_mode(system, "+", (1, 0), outputs=["pusch"])


def test_16_9_quantities_are_converted_at_the_border() -> None:
    import pint

    unit = pint.UnitRegistry()
    spring, damper = Parameter(8 * unit("N/m"), unit="kg/s**2"), Parameter(0.1, unit="kg/s")
    p = parameters(m=2000 * unit.gram, k=spring, c=damper)
    assert (p.m.parameter.default, p.m.parameter.unit) == (2000, "g")
    q = parameters(m=Parameter(2000 * unit.gram, unit="kg"), k=spring, c=damper)
    labels = {"x": "position [m]", "v": "speed [m/s]", "t": "time [s]"}
    system = System({x: v, v: (-q.k * x - q.c * v) / q.m}, labels=labels)
    start = (10 * unit.cm, 0 * unit("km/hour"))
    slow = {"c": 6 * unit("kg/min")}
    run = solve(system, start, (0, 100 * unit.ms), parameters=slow)
    assert run.problem.t_span == (0.0, 0.1)
    assert run.problem.parameters == {"m": 2.0, "k": 8.0, "c": 0.1}
    assert run.x_end == pytest.approx(solve(system, (0.1, 0.0), (0, 0.1)).x_end, abs=0)
    both = {"c": np.array([6, 6]) * unit("kg/min")}
    many = solve_many(system, [(0.1, 0.0)] * 2, (0, 0.1), parameters=both)
    assert many.x[1] == pytest.approx(run.x_end, abs=1e-12)
    for make, error, text in (
        (lambda: solve(system, start, (0, 1), parameters={"c": 1 * unit.kg}), ModelError, "in .kg/s."),
        (lambda: solve(system, (1 * unit.kg, 0), (0, 1)), ModelError, "state 'x' is 1 kilogram"),
        (lambda: solve(System({x: -x}), (1 * unit.m,), (0, 1)), ModelError, "the model gives no unit"),
        (lambda: solve(system, [1, 2] * unit.m, (0, 1)), UsageError, "x0 is the quantity"),
        (lambda: solve_many(system, [[1, 2]] * unit.m, (0, 1)), UsageError, "x0 is a quantity"),
        (lambda: Input("r", [0, 1] * unit.s, [0, 1]), ModelError, "t is a quantity"),
    ):
        with pytest.raises(error, match=text):
            make()
