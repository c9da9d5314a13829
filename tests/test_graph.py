"""Mode graphs against ones derived by hand."""

from __future__ import annotations

import json
import re
from pathlib import Path

import networkx as nx
import pytest
import sympy as sp
from hypothesis import given
from hypothesis import strategies as st

from filippov.base.errors import ModelError, UsageError
from filippov.base.escape import printable
from filippov.graphs.graph import observed_graph, possible_graph, recurrent_part
from filippov.graphs.graph_io import dot_text, graphml_text, load_graph, quoted, save_graph
from filippov.graphs.word import mode_word, periodic_tail
from filippov.model.comparator import Band, Hysteresis
from filippov.model.parameter_symbol import parameters
from filippov.model.surface import Surface
from filippov.model.symbols import states, t
from filippov.model.system import System
from filippov.models import registry
from filippov.solving.solution import Solution
from filippov.solving.solver import solve

x, v, z = states("x v z")


def hunting() -> System:
    p = parameters(m=1, P=10, D=1, I=10, Fs=4, Fc=2, vs=0.1, beta=2, b=1)
    u = p.P * (x + p.D * v + p.I * z)
    g = p.Fc + (p.Fs - p.Fc) * sp.exp(-((abs(v) / p.vs) ** p.beta))
    return System({x: v, v: (-u - g * sp.sign(v) - p.b * v) / p.m, z: x})


@pytest.fixture(scope="module")
def motion() -> Solution:
    return solve(hunting(), (0.1, 0, 0), (0, 20))


def edges(graph: nx.MultiDiGraph) -> set[tuple[str, str, str]]:
    return {(a, b, values["kind"]) for a, b, values in graph.edges(data=True)}


STICK_SLIP = {
    ("-", "+", "crossing"), ("+", "-", "crossing"), ("-", "0", "sliding entry"), ("+", "0", "sliding entry"),
    ("0", "+", "sliding exit"), ("0", "-", "sliding exit"),
}  # fmt: skip


# -- possible transitions --------------------------------------------------------------------------------


@pytest.mark.parametrize("start", [None, "-", (0,), ["+", "0"]])
def test_hunting_has_three_modes_and_six_transitions(start: object) -> None:
    graph = possible_graph(hunting(), start)  # type: ignore[arg-type]
    assert set(graph) == {"+", "0", "-"}
    assert edges(graph) == STICK_SLIP
    assert graph.graph["complete"] is True
    assert graph.nodes["0"]["sliding"] == "v"
    assert graph.nodes["+"]["sliding"] == ""


def test_hunting_guards_against_the_equations_on_v_0() -> None:
    """On v = 0: dv/dt = (-u -+ Fs)/m, and u' = P I x, where u = P (x + I z)."""
    system = hunting()
    assert system.symbolic is not None
    q = {symbol.name: symbol for symbol in system.symbolic.p}
    u = q["P"] * (x + q["I"] * z)
    up, down = (-u - q["Fs"]) / q["m"], (-u + q["Fs"]) / q["m"]
    graph = possible_graph(system)

    def conditions(a: str, b: str) -> list[tuple[str, sp.Expr]]:
        ((_, values),) = graph.get_edge_data(a, b).items()
        return [(c.rel_op, c.lhs - c.rhs) for c in values["conditions"]]

    expected = {
        ("-", "+"): [("==", v), (">", down), (">", up)],
        ("+", "-"): [("==", v), ("<", up), ("<", down)],
        ("-", "0"): [("==", v), (">", down), ("<", up)],
        ("+", "0"): [("==", v), ("<", up), (">", down)],
        ("0", "+"): [("==", v), ("==", up), (">", -q["P"] * q["I"] * x / q["m"])],
        ("0", "-"): [("==", v), ("==", down), ("<", -q["P"] * q["I"] * x / q["m"])],
    }
    for (a, b), wanted in expected.items():
        got = conditions(a, b)
        assert [op for op, _ in got] == [op for op, _ in wanted], (a, b)
        for (_, f), (_, g) in zip(got, wanted, strict=True):
            assert sp.simplify(f - g) == 0, (a, b)
    crossing = graph.edges["-", "+", "v crossing"]
    assert crossing["guard"] == "v = 0 and dv/dt(-) > 0 and dv/dt(+) > 0"
    assert graph.edges["0", "+", "v sliding exit"]["guard"] == "v = 0 and dv/dt(+) = 0 and increasing"
    assert crossing["formula"].startswith("v = 0 and (Fs - P*(I*z + x))/m > 0")
    assert graph.nodes["0"]["multipliers"] == "s[v] = -P*(I*z + x)/Fs"


def test_coulomb_oscillator_with_numbers() -> None:
    """x'' = -x - mu sign(x'): sticks for |x| <= mu and stays, so nothing leaves mode 0."""
    p = parameters(mu=0.5)
    system = System({x: v, v: -x - p.mu * sp.sign(v)})
    free = possible_graph(system, parameters={"mu": 0.25})
    assert edges(free) == {edge for edge in STICK_SLIP if edge[0] != "0"}
    assert free.edges["-", "0", "v sliding entry"]["formula"] == "v = 0 and 1/4 - x > 0 and -x - 1/4 < 0"
    assert recurrent_part(free).graph["components"] == [["0"]]


def test_wide_set_sticks_up_to_its_own_end() -> None:
    p = parameters(Fs=2, Fc=1)
    system = System({x: v, v: -x - p.Fc * sp.sign(v)}, surfaces=[Surface("velocity", v, radius=p.Fs / p.Fc)])
    graph = possible_graph(system)
    assert (
        graph.edges["-", "0", "velocity sliding entry"]["formula"] == "v = 0 and Fc - x > 0 and -Fs - x < 0"
    )
    crossing = graph.edges["-", "+", "velocity crossing"]["formula"]
    assert crossing == "v = 0 and Fc - x > 0 and -Fc - x > 0 and -Fs - x > 0"


def test_relay_only_slides_and_a_kink_is_only_crossed() -> None:
    relay = possible_graph(System({x: -2 * sp.sign(x)}))
    assert edges(relay) == {("+", "0", "sliding entry"), ("-", "0", "sliding entry")} - {
        (a, b, k) for a, b, k in STICK_SLIP if a not in relay
    }
    kink = possible_graph(System({x: 1 + abs(x)}), ["+", "-"])
    assert edges(kink) == {("-", "+", "crossing")}


def test_no_sliding_where_the_sign_does_not_act_on_h() -> None:
    """x'' = -sign(x): h' = x' on both sides, so the surface is crossed."""
    graph = possible_graph(System({x: v, v: -sp.sign(x)}), ["+", "-"])
    assert edges(graph) == {("+", "-", "crossing"), ("-", "+", "crossing")}
    assert graph.edges["+", "-", "x crossing"]["formula"] == "x = 0 and v < 0"


def test_two_surfaces_slide_one_after_the_other() -> None:
    """x' = -sign(x), v' = -2 sign(v): independent, each surface is entered and never left."""
    graph = possible_graph(System({x: -sp.sign(x), v: -2 * sp.sign(v)}), "++")
    assert set(graph) == {"++", "0+", "+0", "00"}
    assert edges(graph) == {
        (a, b, "sliding entry") for a, b in (("++", "0+"), ("++", "+0"), ("0+", "00"), ("+0", "00"))
    }


def test_second_surface_is_judged_with_the_sliding_field_of_the_first() -> None:
    """Sliding on x needs s = v, so that z' = 3 s = 3 v: z is crossed where v < 0, not where a vertex field
    says."""
    system = System({x: v - sp.sign(x), v: sp.S(1), z: 3 * sp.sign(x) + sp.sign(z) / 1000})
    graph = possible_graph(system, "0+", modes=["0+", "0-"])
    assert [values["formula"] for *_, values in graph.edges("0+", data=True)] == [
        "z = 0 and 3*v + 1/1000 < 0 and 3*v - 1/1000 < 0"
    ]


def test_comparators() -> None:
    system = System({x: v, v: -x - sp.sign(v)})
    relay = possible_graph(system.with_comparator(Hysteresis(0.25)))
    assert edges(relay) == {("+", "-", "crossing"), ("-", "+", "crossing")}
    assert relay.edges["+", "-", "v crossing"]["guard"] == "v = -0.25 and dv/dt < 0"
    band = possible_graph(system.with_comparator(Band(0.25)))
    assert set(band) == {"++", "-+", "--"}, "the mode above the upper and below the lower edge does not exist"


def test_modes_are_met_not_enumerated() -> None:
    names = states(" ".join(f"q{i}" for i in range(12)))
    system = System({q: sp.cos(t) - sp.sign(q) / 2 for q in names})
    graph = possible_graph(system, "+" * 12, limit=4)
    assert graph.graph["complete"] is False
    assert sum(values["expanded"] for _, values in graph.nodes(data=True)) == 4
    assert len(graph) <= 1 + 4 * 24
    with pytest.raises(UsageError, match="limit is 1; raise limit"):
        possible_graph(hunting(), modes=["+", "-"], limit=1)


def test_what_does_not_fit_is_refused() -> None:
    with pytest.raises(UsageError, match=r"mode '\+\+' does not fit: expected 1 signs"):
        possible_graph(hunting(), "++")
    with pytest.raises(ModelError, match="did you mean 'Fs'"):
        possible_graph(hunting(), parameters={"fs": 1})
    plain = System(
        field=lambda t, x, p, s: [-s[0]], surfaces=[Surface("a", lambda t, x, p: x[0])], states="x"
    )
    with pytest.raises(ModelError, match="need a system of expressions"):
        possible_graph(plain)


# -- observed transitions --------------------------------------------------------------------------------


def test_observed_counts_and_dwell_times(motion: Solution) -> None:
    graph = observed_graph(motion)
    assert sum(values["count"] for *_, values in graph.edges(data=True)) == len(motion.events)
    assert sum(values["dwell_total"] for _, values in graph.nodes(data=True)) == pytest.approx(20, rel=1e-14)
    assert edges(graph) == {edge for edge in STICK_SLIP if edge[2] != "crossing"}
    stick = graph.nodes["0"]
    lengths = [s.t1 - s.t0 for s in motion.segments if s.mode == (0,)]
    assert stick["visits"] == len(lengths)
    # The first visit was begun before t = 0.
    assert stick["complete"] == len(lengths) - 1
    assert stick["dwell_min"] == min(lengths[1:])
    assert stick["dwell_max"] == max(lengths[1:])
    assert stick["dwell_mean"] == pytest.approx(sum(lengths[1:]) / len(lengths[1:]), rel=1e-14)
    # First break-away: |u| = P (x + I z) = Fs with x = 0.1, z = 0.1 t: t = 0.3.
    assert graph.edges["0", "-", "v sliding exit"]["times"][0] == pytest.approx(0.3, abs=1e-12)


def test_coulomb_oscillator_ends_in_stick() -> None:
    """x'' = -x - sign(x')/2 from x = 2.2: half periods of pi about +-1/2, turning at -1.2 and at 0.2, stuck
    there."""
    solution = solve(System({x: v, v: -x - sp.sign(v) / 2}), (2.2, 0), (0, 20))
    graph = observed_graph(solution)
    assert edges(graph) == {("-", "+", "crossing"), ("+", "0", "sliding entry")}
    assert {mode: values["visits"] for mode, values in graph.nodes(data=True)} == {"-": 1, "+": 1, "0": 1}
    assert graph.nodes["+"]["dwell_total"] == pytest.approx(float(sp.pi), abs=1e-8)
    assert graph.nodes["0"]["dwell_total"] == pytest.approx(20 - 2 * float(sp.pi), abs=1e-8)
    assert set(recurrent_part(graph)) == {"0"}
    assert recurrent_part(graph).number_of_edges() == 0
    assert mode_word(solution) == ""


def test_recurrent_part_leaves_out_the_transient() -> None:
    graph = nx.MultiDiGraph()
    graph.add_edges_from([("--", "+-"), ("+-", "--"), ("+-", "++"), ("++", "0+"), ("0+", "++"), ("--", "00")])
    part = recurrent_part(graph)
    assert part.graph["components"] == [["++", "0+"], ["00"]]
    assert set(part.edges()) == {("++", "0+"), ("0+", "++")}


def test_events_of_one_instant_are_one_edge() -> None:
    """x = v throughout: both surfaces are reached at t = 1 and slid on."""
    system = System({x: -sp.sign(x), v: -sp.sign(v)})
    graph = observed_graph(solve(system, (1, 1), (0, 2)))
    assert list(graph.edges(keys=True)) == [("++", "00", "x, v sliding entry")]
    assert graph.nodes["00"]["dwell_total"] == pytest.approx(1, abs=1e-12)


# -- words -----------------------------------------------------------------------------------------------


def test_word_of_hunting(motion: Solution) -> None:
    assert mode_word(motion) == "stick slip- stick slip+"
    assert mode_word(motion, {}) == "0 - 0 +"
    assert mode_word(motion, {"0": "rest"}) == "rest - rest +"
    assert mode_word(solve(hunting(), (-0.1, 0, 0), (0, 20))) == "stick slip- stick slip+"
    with pytest.raises(UsageError, match="expected a dict"):
        mode_word(motion, "stick")  # type: ignore[arg-type]


def test_word_of_a_driven_belt() -> None:
    """h = v - 1 is a relative velocity: stick-slip of a mass on a belt with the static level twice the
    dynamic one."""
    surface = Surface("relative", v - 1, radius=2)
    solution = solve(System({x: v, v: -x - sp.sign(v - 1)}, surfaces=[surface]), (0, 1), (0, 60))
    assert mode_word(solution) == "stick slip-"


@pytest.mark.parametrize(
    ("sequence", "word"),
    [
        ("", ""), ("a", ""), ("ab", ""), ("abab", "ab"), ("xyzabab", "ab"), ("ababx", ""), ("0-0+0-0+0-0+",
        "0-0+"),
        ("0+0+0-0+0+0-0+0+", "-0+0+0"[1:] + "-"), ("0+" * 9 + "0-" + "0+" * 9 + "0-", "0+" * 9 + "0-"),
    ],
)  # fmt: skip
def test_periodic_tail(sequence: str, word: str) -> None:
    found = "".join(periodic_tail(sequence))
    assert len(found) == len(word)
    assert found in word + word


@given(st.text("abc", min_size=1, max_size=6), st.text("xyz", max_size=5), st.integers(2, 5))
def test_periodic_tail_of_repeated_blocks(block: str, before: str, repeats: int) -> None:
    root = next(block[:p] for p in range(1, len(block) + 1) if block == block[:p] * (len(block) // p))
    # An end of at least two periods that covers all but the first letters; shorter ones inside cannot be as
    # long.
    assert "".join(periodic_tail(before + block * (2 * repeats))) == root


# -- files -----------------------------------------------------------------------------------------------


def test_json_and_graphml_are_read_back_by_networkx(motion: Solution, tmp_path: Path) -> None:
    for graph in (observed_graph(motion), possible_graph(hunting()), recurrent_part(observed_graph(motion))):
        data = json.loads(save_graph(graph, tmp_path / "g.json").read_text())
        read = load_graph(tmp_path / "g.json")
        assert len(data["nodes"]) == len(read) == len(graph)
        assert list(read.edges(keys=True)) == list(graph.edges(keys=True))
        assert dict(read.nodes(data=True)) == dict(graph.nodes(data=True))
        for a, b, key, values in read.edges(keys=True, data=True):
            wanted = {k: w for k, w in graph.edges[a, b, key].items() if k != "conditions"}
            assert values == wanted
        again = nx.parse_graphml(graphml_text(graph), force_multigraph=True)
        assert edges(again) == edges(graph)
        assert dict(again.nodes(data=True)) == dict(graph.nodes(data=True))
    with pytest.raises(UsageError, match=r"did you mean '\.json'"):
        save_graph(graph, tmp_path / "g.jsn")
    (tmp_path / "bad.json").write_text("[1]")
    with pytest.raises(UsageError, match="not a graph in node-link JSON"):
        load_graph(tmp_path / "bad.json")


@given(st.text())
def test_dot_strings_hold_one_token(text: str) -> None:
    token = quoted(text)
    assert re.fullmatch(r'"(?:[^"\\]|\\.)*"', token, re.DOTALL)
    assert "\n" not in token
    undone = re.sub(r"\\(.)", lambda m: "\n" if m[1] == "n" else m[1], token[1:-1])
    assert undone == printable(text, "\n")
    assert "\x1b" not in token


def test_dot_of_a_surface_with_quotes() -> None:
    system = System({x: -sp.sign(x)}, surfaces=[Surface('the "edge" \\ of it', x)])
    text = dot_text(possible_graph(system, "+"))
    assert '"+" -> "0" [label="the \\"edge\\" \\\\ of it: sliding entry\\n' in text
    assert text.count("{") == text.count("}") == 1
    assert '"0" [label="0", shape=box' in text


# -- resets and clocks ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "options"),
    [
        ("bouncing_ball", {"t_span": (0, 4), "zeno": "continue"}), ("impact_oscillator", {}),
        ("buck_pwm", {}), ("reset_control", {}),
    ],
)  # fmt: skip
def test_every_observed_transition_is_possible(name: str, options: dict[str, object]) -> None:
    model = registry.get(name)
    solution = solve(model.build(), model.x0, **{"t_span": model.t_span, **options})
    possible = possible_graph(solution.system)
    assert possible.graph["complete"] is True
    single = {edge for edge in edges(observed_graph(solution)) if ", " not in edge[2]}
    assert single
    assert single <= edges(possible)


def test_the_ball_rests_by_a_limit_of_impacts_and_stays() -> None:
    graph = possible_graph(registry.get("bouncing_ball").build())
    assert edges(graph) == {("+", "+", "reset"), ("+", "0", "sliding entry"), ("-", "+", "crossing")}
    reset = graph.edges["+", "+", "floor reset"]
    assert reset["guard"] == "y = 0 and dy/dt < 0"


def test_contact_is_left_where_nothing_presses() -> None:
    """A body on a wall that is pulled by F = t - 1: d2h/dt2 = t - 1 grows through 0 at t = 1."""
    y, w = states("y w")
    system = System({y: w, w: t - 1}, surfaces=[Surface("wall", y, reset={w: -w / 2})])
    ((_, values),) = possible_graph(system, ["+", "0"]).get_edge_data("0", "+").items()
    assert values["guard"] == "d2y/dt2 = 0 and increasing"
    assert values["conditions"] == (sp.Eq(t - 1, 0),)


def test_a_jump_over_another_surface_changes_its_sign() -> None:
    """At x = 1 the state is set to -1, across the kink x = 0."""
    system = System(
        {x: 1 + abs(x)},
        surfaces=[Surface("threshold", 1 - x, reset={x: -1}), Surface("kink", x, kind="kink")],
    )
    found = {edge for edge in edges(possible_graph(system, "++")) if edge[2] == "reset"}
    assert found == {("++", "+-", "reset")}


def test_12_10_contact_begins_only_where_the_other_surfaces_allow_it() -> None:
    """v = 0 lies below v = 1: rest on the wall x = 0 is entered from the modes with v < 1 alone."""
    wall = Surface("wall", x, reset={v: -v / 2}, side="+")
    graph = possible_graph(System({x: v, v: -1 - sp.sign(v - 1) / 2}, surfaces=[wall]))
    assert {source for source, target in graph.edges() if target[0] == "0" and source[0] != "0"} == {"+-"}
    assert "0+" not in graph
