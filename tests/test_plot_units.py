"""Units on every axis of the figures of results, without a label given."""

import numpy as np
import pytest
from matplotlib import pyplot as plt

from filippov import (
    Parameter,
    Surface,
    System,
    UsageError,
    analysis,
    exp,
    parameters,
    plot,
    sign,
    solve,
    states,
    t,
)
from filippov.graphs import observed_graph
from filippov.models import Coulomb, get
from filippov.models.driven import driven_mass

HUNTING = get("hunting")
SYSTEM = HUNTING.build()
SECTION = analysis.Section.from_model(HUNTING)
P = ("P", np.array([10.0, 26.0]))
I = ("I", np.array([8.0, 10.0]))


@pytest.fixture(autouse=True)
def closed():
    yield
    plt.close("all")


def axes_of(figure):
    return [(ax.get_xlabel(), ax.get_ylabel()) for ax in figure.axes if ax.get_xlabel()]


def regions():
    return plot.plot_regions(analysis.regions(SYSTEM, SECTION, P, I, (0.0, 0.5), points=8))


def gain_map():
    return plot.plot_gain_maps([analysis.gain_map(SYSTEM, SECTION, P, I, (0.0, 0.5), points=4)])


def basin():
    return plot.plot_basin(
        analysis.basin(SYSTEM, SECTION, ("x", np.array([0.0, 0.3])), ("v", np.array([0.0, 0.1])), (0.0, 0.5))
    )


def brute_force():
    found = analysis.brute_force(SYSTEM, SECTION, "P", [10.0, 11.0], 0.1, keep=4, transient=4)
    return plot.plot_brute_force(found)


def diagram():
    found = analysis.bifurcation(
        SYSTEM, SECTION, parameter="P", values=[20.0, 22.0], interval=(0.0, 0.5), order=2
    )
    return plot.plot_diagram(found)


def event_map():
    return plot.plot_event_map(analysis.EventMap(SYSTEM, SECTION), 0.1, 0.3, points=5)


def iterates():
    return plot.plot_iterates(analysis.EventMap(SYSTEM, SECTION), 0.1, 3, points=5)


def branch():
    run = analysis.continuation(
        SYSTEM, (analysis.EventMap(SYSTEM, SECTION, order=2), 0.2523), parameter="P", bounds=(9.9, 10.1)
    )
    run.run()
    return run.branch.plot()


CASES = {
    regions: ("P [N/m]", "I [1/s]"), gain_map: ("P [N/m]", "I [1/s]"),
    basin: ("position [m]", "velocity [m/s]"), branch: ("P [N/m]", "position [m]"),
    brute_force: ("P [N/m]", "position [m] at the event"), diagram: ("P [N/m]", "position [m] at the event"),
    event_map: ("position [m] at the event", "position [m] at event 1 after it"),
    iterates: ("position [m] at the event", "position [m] at event 1 after it"),
}  # fmt: skip


@pytest.mark.parametrize("draw", CASES, ids=lambda draw: draw.__name__)
def test_results_have_the_units_of_their_system(draw):
    assert axes_of(draw())[0] == CASES[draw]


def test_at_a_reset_the_speed_after_it_is_read_and_said():
    """A ball leaves the ground with half the speed that it left it with before."""
    y, v = states("y v")
    ball = System(
        {y: v, v: -9.81}, surfaces=[Surface("ground", y, reset={v: -v / 2})], labels={"v": "velocity [m/s]"}
    )
    found = analysis.EventMap(ball, analysis.Section("ground", "reset", "v", {"y": "0", "v": "d"}))
    assert found(2.0) == pytest.approx(1.0, abs=1e-9)
    drawn = axes_of(plot.plot_event_map(found, 0.5, 2.0))[0]
    assert drawn == ("velocity [m/s] after the reset", "velocity [m/s] after reset 1 from it")
    assert "the state after it" in analysis.Section.__doc__


def test_labels_of_a_branch_are_kept_in_its_file(tmp_path):
    x, = states(["x"])
    p = parameters(r=Parameter(1.0, unit="V"))
    system = System({x: p.r - x**3}, labels={"x": "current [A]"})
    run = analysis.continuation(system, (1.0,), parameter="r", bounds=(0.5, 2.0), mode="")
    run.run()
    read = analysis.Branch.load(run.branch.save(tmp_path / "branch.json"))
    assert axes_of(read.plot()) == [("r [V]", "current [A]")]


def test_rates_are_per_unit_of_time():
    y, v = states("y v")
    damped = {"y": "level [m]", "t": "time [h]"}
    system = System({y: v, v: -y - v - sign(y + v)}, surfaces=[Surface("relay", y + v)], labels=damped)
    found = analysis.lyapunov(system, (1.0, 0.0), 2.0, interval=0.5)
    drawn = axes_of(plot.plot_lyapunov(found))
    assert drawn == [("time that the estimate rests on [h]", "Lyapunov exponents [1/h]")]
    predicted = analysis.describing_function(system, "relay")
    assert predicted.labels["growth"] == "growth rate [1/h]"
    assert predicted.labels["frequency"] == "frequency [rad/h]"
    bare = analysis.describing_function(System({y: v, v: -y - v - sign(y)}, surfaces=[Surface("relay", y)]))
    assert bare.labels["growth"] == "growth rate [1/time]"


def test_durations_of_an_observed_graph():
    figure = plot.plot_graph(observed_graph(solve(SYSTEM, HUNTING.x0, (0, 5))))
    told = [ax.get_legend().get_title().get_text() for ax in figure.axes if ax.get_legend()]
    assert told == ["in a mode: times entered × mean duration [s]"]


V = np.linspace(0.1, 2.0, 12)


def fitted_figures(system, force):
    """The figures of a curve and of a record, v' = -2 from 1 for half a unit of time."""
    t = np.linspace(0.0, 0.45, 10)
    curve = analysis.identify_curve(analysis.Curve(V, 2.0 + 0.0 * V), system, ["Fc"])
    record = analysis.Record(t, t - t**2, 0.0 * t)
    free = analysis.identify(record, system, ["Fc"], windows=1, hold="zero")
    yield plot.plot_identification(curve, force, points=(V, 2.0 + 0.0 * V))
    yield plot.plot_identification(free, force)


def test_an_identification_has_the_units_of_its_system():
    law = driven_mass(Coulomb(2.0))
    curve, record = fitted_figures(law, lambda v, q: q["Fc"] * np.sign(v))
    wanted = ("velocity [m/s]", "friction force [N]")
    assert axes_of(curve) == [wanted]
    assert axes_of(record) == [("time [s]", "residual [m]"), wanted]


@pytest.mark.parametrize("units", [{}, {"force": "N m", "interval": "ms"}])
def test_an_identification_in_other_units_or_none(units):
    """A motor's rotor: an angle, a torque; or no unit at all."""
    x, v = states("x v")
    of_input = {"force": 0.0, "change": 0.0, "bend": 0.0, "twist": 0.0, "interval": 1.0}
    p = parameters(m=1.0, Fc=1.5, **{n: Parameter(q, units.get(n, "")) for n, q in of_input.items()})
    u = p.force + t * (p.change + t * (p.bend + t * p.twist))
    labels = {"x": "angle [rad]", "v": "speed [rad/ms]"} if units else None
    rotor = System({x: p.interval * v, v: p.interval * (u - p.Fc * sign(v)) / p.m}, labels=labels)
    curve, record = fitted_figures(rotor, lambda v, q: q["Fc"] * np.sign(v))
    wanted = ("speed [rad/ms]", "friction force [N m]") if units else ("velocity", "friction force")
    assert axes_of(curve) == [wanted]
    residual = ("time [ms]", "residual [rad]") if units else ("time", "residual")
    assert axes_of(record) == [residual, wanted]
    assert record.axes[0].get_ylabel() == ("angle [rad]" if units else "position")


def test_labels_of_an_identification():
    found = analysis.identify_curve(analysis.Curve(V, 2.0 + 0.0 * V), driven_mass(Coulomb(2.0)), ["Fc"])
    figure = plot.plot_identification(found, lambda v, q: q["Fc"] * np.sign(v), points=(V, V),
                                      labels={"force": "torque [N m]"})  # fmt: skip
    assert axes_of(figure) == [("velocity [m/s]", "torque [N m]")]
    with pytest.raises(UsageError, match="unknown label 'forces'; did you mean 'force'"):
        plot.plot_identification(found, lambda v, q: v, labels={"forces": ""})


BELT = parameters(vb=Parameter(0.1, "mm/s"))


def belt(labels):
    """A block on a belt: h = v - vb has the unit of v, the way slipped that of x."""
    x, v = states("x v")
    rel = v - BELT.vb
    return System({x: v, v: -x - 0.3 * sign(rel)}, surfaces=[Surface("belt", rel)], labels=labels)


LABELLED = {"x": "position [mm]", "v": "velocity [mm/s]", "t": "time [s]"}


@pytest.mark.parametrize(
    ("labels", "against", "quantity", "wanted"),
    [
        (LABELLED, ["band"], "drift", ("half-width [mm/s]", "drift in stick [mm]")),
        (LABELLED, ["moreau"], "error_times", ("step [s]", "error of event times [s]")),
        (LABELLED, ["band", "moreau"], "error_final",
         ("half-width [mm/s], or step [s]", "error of the final state over its extent")),
        (None, ["band"], "drift", ("half-width", "drift in stick")),
    ],
)  # fmt: skip
def test_a_comparison_of_solutions_has_the_units_of_its_system(labels, against, quantity, wanted):
    found = analysis.compare(belt(labels), (0.5, 0.0), (0.0, 3.0), against=against, widths=(1e-2, 1e-3))
    figure = found.plot(quantity=quantity)
    drawn = [(ax.get_xlabel(), ax.get_ylabel().replace("\n", " ")) for ax in figure.axes]
    assert wanted in drawn
    gap = next(ax.get_ylabel() for ax in figure.axes if "|error of x|" in ax.get_ylabel())
    assert gap == ("|error of x|\n[mm]" if labels else "|error of x|")


@pytest.mark.parametrize(("scale", "unit"), [(1.0, " [mm/s]"), (2.0, "")])
def test_a_comparison_over_a_section_has_the_units_of_its_system(scale, unit):
    """2 v has no unit that is written anywhere."""
    x, v = states("x v")
    rel = v - 0.3
    block = System({x: v, v: -25 * x - 2 * (1 + exp(-abs(rel) / 0.1)) * sign(rel)},
                   surfaces=[Surface("belt", scale * rel)], labels=LABELLED)  # fmt: skip
    section = analysis.Section("belt", "sliding entry", "x", {"x": "d", "v": "0.3"})
    found = analysis.compare(
        block, section, widths=(1e-3,), interval=(-0.15, 0.1), comparators=("band",), repeats=1
    )
    drawn = [(ax.get_xlabel(), ax.get_ylabel()) for ax in found.plot().axes]
    errors = ["error of R(d) [mm]", "drift during stick [mm]", "field calls"]
    assert drawn == [(f"half-width of the band{unit}", error) for error in errors]


def test_a_cycle_that_a_basin_belongs_to_has_a_unit():
    legend = basin().legends[0]
    assert "cycle, d = 0.2523 m" in [text.get_text() for text in legend.get_texts()]
