"""What a System answers to names that are looked for in it by mistake."""

# Keywords that belong to something else.
ANSWERS = {
    "x0": "x0 belongs to the run: solve(system, x0=(...), t_span=(t0, t1)).",
    "t_span": "t_span belongs to the run: solve(system, x0=(...), t_span=(t0, t1)).",
    "events": "events belong to the run: solve(system, ..., events=g). What switches is found in the "
    "equations, or is a Surface of surfaces=.",
    "f": "f is field here: System(field=f, states='x v').",
    "units": "units stand in labels={'x': 'position [m]'} and in Parameter(1.0, 'kg').",
    "comparator": "comparator is given to a system that is there: system.with_comparator(Band(width)).",
}
# What is asked of a system and stands elsewhere.
ELSEWHERE = {
    **dict.fromkeys(("solve", "simulate", "run", "integrate"), "solve(system, x0, t_span) solves it."),
    "plot": "solve(system, x0, t_span).plot() draws a solution.",
    **dict.fromkeys(("n", "order", "size"), "its number of states is dimension."),
    **dict.fromkeys(("equilibria", "linearise"), "filippov.analysis has it as a function of the system."),
}
