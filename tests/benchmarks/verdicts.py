"""The truths of tests/stability_models.py against motions from 50 states each.

    python tests/benchmarks/verdicts.py [NAME OR KIND ...]

Prints a row for each case that the motions contradict or leave open, and what was counted. An asymptotically
stable case must come down to a part of its radius that it names, an unstable one must leave by 10 radii from
one of the states at least, a stable one must stay within 8 radii. A motion that the solver cannot continue is
taken up to where it ended: it counts where it has left, or has come down that far (a relay of relative degree
2 switches infinitely often on its way).
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "tests")]

from stability_models import AS, KINDS, ST, UN, Case  # noqa: E402

from filippov import solve  # noqa: E402

STARTS, LEAVES, STAYS = 50, 10.0, 8.0


def contradiction(case: Case, seconds: float = 20.0) -> str:
    """What the motions say against the truth; "" where nothing, "open: ..." where they are no proof."""
    rng = np.random.default_rng(1)
    at = np.array(case.at, dtype=float)
    near = at if case.start is None else np.array(case.start, dtype=float)
    distance = case.distance or (lambda q: float(np.max(np.abs(np.asarray(q) - at))))
    reset = [s for s in case.system.surfaces if s.kind == "reset"]
    ends, peaks, bad, begun = [], [], [], time.process_time()
    while len(ends) + len(bad) < STARTS and time.process_time() - begun < seconds:
        x0 = near + case.radius * rng.uniform(-1, 1, at.size)
        if reset and any(e.reset is not None and e.side == "+" for e in reset):
            x0 = np.abs(x0) if at.size < 4 else np.array([x0[0] + 2 * case.radius, *x0[1:]])
            if at.size == 4:
                x0[0], x0[2] = (abs(x0[0]) + case.radius, abs(x0[2])) if len(reset) < 2 else (
                    abs(x0[0]), abs(x0[0]) + abs(x0[2]))  # fmt: skip
        run = solve(
            case.system, x0, (0, case.length), rtol=1e-8, atol=1e-12, zeno="continue", nonunique="stick",
            max_events=5_000, simultaneous="sequential",
        )  # fmt: skip
        far = [distance(q) for q in run.y.T]
        small = far[-1] <= case.decays * case.radius * (1 if case.truth == AS else 1e-2)
        if not run.success and not small and max(far) < LEAVES * case.radius:
            bad.append(str(run.status))
            continue
        ends.append(far[-1])
        peaks.append(max(far))
    if not ends:
        return f"open: {bad[:3]}"
    note = f" ({len(ends)} of {STARTS}, {sorted(set(bad))})" if len(ends) < STARTS else ""
    end, peak = max(ends) / case.radius, max(peaks) / case.radius
    attracted = end < 0.05 and case.distance is None
    wrong = {AS: end > case.decays, UN: peak < LEAVES, ST: peak > STAYS or attracted}
    if wrong[case.truth]:
        return f"{case.truth}, ends at {end:.3g} and peaks at {peak:.3g} radii{note}"
    return f"open: only{note}" if note else ""


def main(names: list[str]) -> int:
    """Check the cases named, or all."""
    count = wrong = 0
    for kind, make in KINDS.items():
        for case in make():
            if names and case.name not in names and kind not in names:
                continue
            count += 1
            said = contradiction(case)
            wrong += bool(said) and not said.startswith("open")
            if said:
                print(f"{kind}: {case.name}: {said}", flush=True)
    print(f"{count} cases, {wrong} contradicted")
    return int(wrong > 0)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
