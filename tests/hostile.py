"""Formulas as somebody might write them who means harm: short texts that stand for endless work."""

from __future__ import annotations

import random

SMOOTH = ("sin", "cos", "tan", "exp", "log", "sqrt", "tanh", "sinh", "cosh", "asin", "atan")
BENT = ("Abs", "sign", "Heaviside")


def formula(draw: random.Random, names: list[str], size: int = 40) -> str:
    """A random text in the language of expressions, of about so many parts."""
    kinds = ("deep", "tower", "sum", "product", "choice", "bent", "mixed")
    kind = draw.choice(kinds if size > 3 else kinds[:2])
    if kind == "deep":
        text = draw.choice(names)
        for _ in range(draw.randint(1, size)):
            outer = f"{draw.choice(SMOOTH)}({text})"
            text = draw.choice((outer, f"1/({text}+{_number(draw)})", f"({text})**2-{text}"))
            if len(text) > 3_000:
                break
        return text
    if kind == "tower":
        inner = "+".join(draw.choices([*names, "1", "t"], k=draw.randint(2, 6)))
        for _ in range(draw.randint(1, 4)):
            inner = f"({inner})**{draw.choice((2, 3, 20, 60, 64, -64, '0.5', '(1/3)', draw.choice(names)))}"
        return inner
    if kind == "sum":
        return "+".join(_term(draw, names) for _ in range(draw.randint(2, 10 * size)))
    if kind == "product":
        return "*".join(
            f"({draw.choice(names)}+{_number(draw)}*{draw.choice(names)}+{_number(draw)})"
            for _ in range(draw.randint(2, 2 * size))
        )
    if kind == "choice":
        parts = [_term(draw, names) for _ in range(draw.randint(2, size))]
        return f"{draw.choice(('Max', 'Min'))}({','.join(parts)})"
    if kind == "bent":
        text = _term(draw, names)
        for _ in range(draw.randint(1, size // 3)):
            text = f"{draw.choice(BENT)}({text}{draw.choice('+-*')}{_term(draw, names)})"
        return text
    op = draw.choice(("+", "*", "-", "/"))
    return f"({formula(draw, names, size // 2)}){op}({formula(draw, names, size // 2)})"


def parameters(draw: random.Random, names: list[str]) -> dict[str, str]:
    """Names for formulas, each made of those before it."""
    out: dict[str, str] = {}
    for k in range(draw.choice((0, 0, 1, 3, 12, 40))):
        known = [*names, *out]
        last = known[-1]
        out[f"K{k}"] = draw.choice(
            (
                f"{last}*({last}+1)", f"{last}**60", f"sin({last})", f"{last}+{last}**2",
                formula(draw, known, 6),
            )
        )  # fmt: skip
    return out


def case(draw: random.Random) -> dict[str, object]:
    """A case of a bank with such formulas everywhere."""
    names = ["x", "y"]
    given = parameters(draw, names)
    known = [*names, *given, "t"]
    case: dict[str, object] = {
        "id": "H", "states": names, "params": given, "x0": [0.1, 0.2], "t_span": [0, 1e-3],
        "expected": [{"name": "final_state", "value": [0, 0], "tol": 1}],
    }  # fmt: skip
    if draw.random() < 0.5:
        case["smooth_field"] = [formula(draw, known), "-y"]
    else:
        count = draw.choice((1, 1, 2, 12))
        case["h"] = [formula(draw, known, 6) for _ in range(count)]
        case["fields"] = {"+" * count: [formula(draw, known, 6), "1"], "-" * count: ["-x", "1"]}
    return case


def _number(draw: random.Random) -> str:
    return draw.choice(("1", "2", "0.1", "1e-9", "123456789", "3"))


def _term(draw: random.Random, names: list[str]) -> str:
    name = draw.choice(names)
    power = f"{name}**{draw.randint(2, 9)}"
    return draw.choice((name, f"{_number(draw)}*{name}", f"{draw.choice(SMOOTH)}({name})", power))
