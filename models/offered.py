"""What the command offers by name, known without importing a model: an example of each command, laws."""

from __future__ import annotations

# Command -> an example of it.
EXAMPLES: dict[str, str] = {
    "simulate": "filippov simulate hunting -p P=20 --x0 x=0.1 --t-span 0 50 -o results/run",
    "sweep": "filippov sweep hunting --over P=10:30:21 --measure 'amplitude(x)' -j 2 -o results/sweep",
    "ensemble": (
        "filippov ensemble hunting --over x0.x=-0.3:0.3 --over P=10:30 --samples sobol -n 1000 -o "
        "results/ensemble"
    ),
    "event-map": "filippov event-map hunting --order 2 --start 0.1 -o results/map",
    "bifurcation": "filippov bifurcation hunting --over P=10:31 -o results/bifurcation",
    "orbit": "filippov orbit belt -o results/orbit",
    "continue": "filippov continue hunting --over P=10:31 --start 0.25 -o results/branch",
    "stability": "filippov stability hunting -p beta=1 --solve-for P",
    "describing-function": "filippov describing-function relay -o results/prediction",
    "regions": "filippov regions hunting --over P=10:31 --over I=2:20 --borders exact -o results/regions",
    "basin": "filippov basin hunting --over x=-0.4:0.4 --over v=-2:2 -o results/basin",
    "attractors": (
        "filippov attractors impact_oscillator --box x=-2:0 --box v=-2:2 --plane x,v -o "
        "results/attractors"
    ),
    "lyapunov": "filippov lyapunov buck_pwm -p Vin=33 --duration 0.1 --interval 4e-4 --transient 0.04",
    "diagram": "filippov diagram hunting --over P=10:31 -o results/diagram",
    "tune": "filippov tune hunting --over P=5:60 --over I=1:20 -o results/tuning",
    "identify": (
        "filippov identify measured.csv --law stribeck --fixed m=1 --fixed beta=2 -o "
        "results/friction"
    ),
    "compare": "filippov compare hunting --widths 1e-2,1e-4,1e-6 -o results/comparison",
    "graph": "filippov graph hunting --kind observed --t-span 0 100 -o results/graph",
    "export": "filippov export hunting -p P=20 --to c -o hunting.c",
    "explore": "filippov explore hunting -p P=20",
    "models": "filippov models describe hunting",
    "study": "filippov study hunting -o results/hunting",
}

# Friction law that `filippov identify` fits -> its class in `filippov.models`; the one by default.
LAWS = {"coulomb": "Coulomb", "static": "StaticCoulomb", "stribeck": "Stribeck", "hyperbolic": "Hyperbolic"}
LAW = "stribeck"
