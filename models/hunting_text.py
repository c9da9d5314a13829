"""The words of the hunting study: {fold_2:.8f} and the like stand for computed values."""

from __future__ import annotations


def flow(text: str) -> str:
    """Text in one line."""
    return " ".join(text.split())


SUMMARY = (
    flow(
        """
        A mass under dry Stribeck friction is held at 0 by a PID controller: m v' ∈ −u −
        F(v), x' = v, z' = x, u = P (x + D v + I z). Friction at rest is a set, so the loop
        is a differential inclusion. It is solved as one: stick is a sliding mode on the
        surface v = 0, slip is a smooth equation on each side, and every change between them
        is an event that is located and landed on. There is no band around v = 0.
        """
    ),
    flow(
        """
        With β = 2 the loop has two limit cycles at P = 10 N/m, an unstable one at d =
        {cycle_2_1:.10f} m and a stable one at d = {cycle_2_2:.10f} m: which of hunting and
        rest is reached depends on the start. Both vanish in a fold at P = {fold_2:.8f} N/m.
        With β = 1 the stable cycle shrinks into the equilibrium set at P = {change_1:.8f}
        N/m, below the Routh-Hurwitz bound of {bound_1:g} N/m. With β = 0.5 the set is
        unstable and the loop hunts at every gain that was computed.
        """
    ),
)

DIFFERENCES = (
    (
        "The stick force",
        flow(
            """
            Equation 1 of the paper prints the stick force with the sign that doubles u
            in place of cancelling it. Its equation 2, the inclusion, is right and is
            what is solved here.
            """
        ),
    ),
    (
        "The simulation model",
        flow(
            """
            The paper integrates the Switch model, three ordinary differential equations
            with a band of half-width 1e-8 m/s around v = 0. Here the inclusion itself
            is integrated: in stick the position is constant to the last bit and v is
            exactly on the surface. The comparison above tells how far the band models
            are from it.
            """
        ),
    ),
    (
        "Stability of the equilibrium set for β > 1",
        flow(
            """
            The paper's table 4 says stable. That is so on its range of gains, and for
            every P above {change_rest_2:.8f} N/m; below it the linearised return map at
            the ends of the set repels. The Routh-Hurwitz condition asks for P >
            {bound_2:g} N/m. Both values are below the range of the diagrams.
            """
        ),
    ),
    (
        "Where the set changes stability for β = 1",
        flow(
            """
            The paper reads it off the diagram, near P = 27 N/m. Here it is the root of
            |slope| = 1 of the second iterate at the set, {change_1:.8f} N/m, and it
            agrees with the closed return map of the linearised slip,
            {change_rest_1:.8f} N/m. Routh-Hurwitz, {bound_1:g} N/m, is sufficient and
            not necessary, as the paper says: slip ends before an unstable root can act
            for long.
            """
        ),
    ),
    (
        "The map at the origin for β = 0.5",
        flow(
            """
            The friction curve has an infinite slope at v = 0, so the map does not pass
            through the origin: P(0+) = {jump_0_5:.8f} m. A motion that leaves the set,
            from however near, comes to rest that far away. The slope of the second
            iterate at d = 0 is infinite, not a large number; summary.json has null and
            a note in its place.
            """
        ),
    ),
    (
        "Figures of the paper",
        flow(
            """
            The scan of the paper that was at hand has lost many digits. The figures in
            the columns ‘paper’ are those that survive or were restored by computing
            them; the reference values in brackets are from a 40-digit Taylor
            integration. Of the acceleration coefficient of the Switch model one digit
            survives, 1; 100 1/s is taken. The length of the paper's time axis is not
            known; 20 s are shown. Tables 1 and 4 carry the paper's numbers; tables 2
            and 3 gather figures of its text and diagrams.
            """
        ),
    ),
    (
        "Table 4 is a statement about a range",
        flow(
            """
            ‘Always’ and ‘never’ in the computed column mean: at every gain that was
            computed, which are named below the table. For β < 1 the instability of the
            set is proved for every gain (see the stability report); that a cycle exists
            is a computation.
            """
        ),
    ),
)

CAPTIONS = {
    "friction": flow(
        """
        The force is a set at v = 0, the thick bar. The slope beside it is 0 for β = 2,
        finite for β = 1 and infinite for β = 0.5; that decides what a linearisation can
        say.
        """
    ),
    "response": flow(
        """
        Shaded: stick. In stick the friction takes any value between -1 and 1 times Fs and
        cancels u; slip begins where it reaches ±1.
        """
    ),
    "phase": flow(
        """
        The equilibrium set is the segment x = v = 0, |z| ≤ Fs/(P I): a point in the left
        plane, a segment in the right one.
        """
    ),
}
