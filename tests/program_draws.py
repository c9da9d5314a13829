"""Programs f(t, y) drawn at random, as text: assignments, branches, early returns, loops, helpers, numpy."""

import random

HEAD = """import math
import numpy as np

gain = {gain}
params = {{"a": {a}, "list": [0.3, -0.7, 1.1]}}


class Box:
    def __init__(self):
        self.level = {level}

    def bent(self, u):
        if u > self.level:
            return u - self.level
        return -0.5 * u


box = Box()


def shaped(u, k=1.5, *, top=2.0):
    if u > top:
        return top
    elif u < -top:
        return -top * k
    out = u
    for j in range(3):
        if out > 0.4 * j:
            out -= 0.1
        else:
            break
    return out


"""


class Draw:
    """One program with three states and local numbers a, b, c, w[0..1]."""

    def __init__(self, seed: int) -> None:
        self.random = random.Random(seed)  # noqa: S311  (draws of a test)
        self.depth = 0

    def number(self) -> str:
        return f"{self.random.uniform(0.2, 2.0):.2f}"

    def atom(self) -> str:
        return self.random.choice(
            ["x", "v", "z", "a", "b", "w[0]", "w[1]", "y[0]", "gain", "params['a']", "q", self.number()]
        )

    def expression(self, depth: int = 0) -> str:
        pick = self.random.choice
        if depth > 1 or self.random.random() < 0.3:
            return self.atom()
        u, v = self.expression(depth + 1), self.expression(depth + 1)
        return pick(
            [
                f"({u} + {v})",
                f"({u} - {v})",
                f"{self.number()} * {u}",
                f"({u}) * ({self.atom()})",
                f"np.sin({u})",
                f"math.tanh({u})",
                f"np.sign({u})",
                f"abs({u})",
                f"max({u}, {v})",
                f"np.minimum({u}, {v})",
                f"np.clip({u}, -1.0, {self.number()})",
                f"np.where({self.condition(2)}, {u}, {v})",
                f"({u} if {self.condition(2)} else {v})",
                f"np.heaviside({u}, 0.5)",
                f"shaped({u})",
                f"box.bent({u})",
                f"shaped({u}, top={self.number()})",
                f"({self.condition(2)}) * ({u})",
                f"math.copysign({self.number()}, {u})",
                f"sum(p * {u} for p in params['list'])",
                f"(lambda s: s - {self.number()})({u})",
                f"np.array([{u}, {v}]).sum()",
                f"np.dot([{u}, 1.0], [{v}, 2.0])",
            ]
        )

    def condition(self, depth: int = 0) -> str:
        kind = self.random.random()
        if kind < 0.55 or depth > 2:
            how = self.random.choice(["<", "<=", ">", ">="])
            return f"{self.atom()} - {self.number()} {how} {self.random.choice(['x', 'v', 'z'])}"
        a, b = self.condition(depth + 1), self.condition(depth + 1)
        if kind < 0.7:
            return f"({a} and {b})"
        if kind < 0.85:
            return f"({a} or not ({b}))"
        return f"-{self.number()} < {self.random.choice(['x', 'v', 'z'])} <= {self.number()}"

    def block(self, indent: str, size: int, loop: bool = False) -> list[str]:
        out: list[str] = []
        for _ in range(size):
            out += self.statement(indent, loop)
        return out

    def statement(self, indent: str, loop: bool) -> list[str]:
        kind = self.random.random()
        name = self.random.choice(["a", "b", "q", "w[0]", "w[1]", "x", "d[1]"])
        if self.depth >= 2 or kind < 0.4:
            how = self.random.choice(["=", "+=", "="])
            return [f"{indent}{name} {how} {self.expression(1)}"]
        self.depth += 1
        try:
            if kind < 0.6:
                out = [f"{indent}if {self.condition()}:", *self.block(indent + "    ", 2, loop)]
                if self.random.random() < 0.5:
                    out += [f"{indent}elif {self.condition()}:", *self.block(indent + "    ", 1, loop)]
                if self.random.random() < 0.6:
                    out += [f"{indent}else:", *self.block(indent + "    ", 1, loop)]
                return out
            if kind < 0.75:
                return [
                    f"{indent}if {self.condition()}:",
                    f"{indent}    return [v, {self.expression(1)}, {self.atom()}]",
                ]
            if kind < 0.9 and not loop:
                body = self.block(indent + "    ", 1, loop=True)
                word = self.random.choice(["break", "continue"])
                leave = [f"{indent}    if {self.condition(1)}:", f"{indent}        {word}"]
                body += leave if self.random.random() < 0.5 else []
                return [f"{indent}for i in range(2):", *body, f"{indent}    a += 0.1 * y[i]"]
            return [f"{indent}a, b = b, {self.expression(1)}"]
        finally:
            self.depth -= 1

    def text(self) -> str:
        head = HEAD.format(gain=self.number(), a=self.number(), level=self.number())
        body = [
            "def f(t, y, q=0.4):",
            "    x, v, z = y",
            "    a, b = v, 0.3",
            "    w = np.zeros(2)",
            "    d = np.zeros(3)",
        ]
        body += self.block("    ", self.random.randint(2, 4))
        body += [f"    d[0] = {self.expression(1)}", f"    d[2] += {self.expression(1)} + np.sin(t)"]
        return head + "\n".join(body) + "\n    return d\n"
