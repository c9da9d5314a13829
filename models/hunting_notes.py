"""Paragraphs of the hunting study's further sections: {fold_2:.8f} and the like stand for computed values."""

from __future__ import annotations

from filippov.models.hunting_text import flow

NOTES: dict[str, tuple[str, ...]] = {
    "cycles": (
        flow(
            """
            Every cycle sticks and slips twice a period and is symmetric, x(t + T/2) = −x(t). The unstable
            one at β = 2 takes 20 times as long as the stable one: it waits in stick for the integral.
            """
        ),
    ),
    "branches": (
        flow(
            """
            The diagrams above are cycles at 22 gains. Here each cycle is followed continuously while P
            changes. For β = 2 the stable and the unstable cycle are one branch, which turns back in the fold
            at P = {fold_2:.8f} N/m; above it there is no hunting. For β = 1 the cycle shrinks into the
            equilibrium set at P = {change_1:.8f} N/m. For β = 0.5 it goes on beyond the range.
            """
        ),
    ),
    "fold_curve": (
        flow(
            """
            Where hunting ends, over the exponent. The curve ends at β = 1, at P = {end_value:.4f} N/m, the
            gain at which for β = 1 the equilibrium set changes stability. For β > 1 the friction curve is
            flat at v = 0 and the set is stable, but its basin is bounded by the unstable cycle. As β
            goes to 1 the flat part shrinks to nothing, and the unstable cycle with it: at the fold both
            cycles have to vanish together with it, which they can do only where the stable cycle of
            β = 1 shrinks into the set. The gain that ends hunting is least, {least_value:.4f} N/m, at β =
            {least_parameter:.3f}.
            """
        ),
    ),
    "regions": (
        flow(
            """
            The cells count cycles up to the end of the interval, 0.5 m; larger ones, such as the stable
            partner of a single unstable cycle, are not counted. The lines are not read off the cells but
            followed. Right of the fold the loop cannot hunt. Left of the other line the equilibrium set
            repels as well.
            """
        ),
    ),
    "settings": (
        flow(
            """
            Gains are free of hunting where every excursion comes back smaller. For β = 2 and β = 1 there
            are such gains, and the best of those that were found lie in the corner of a high P and a low I.
            For 0 < β < 1 and for static + Coulomb friction there are none: the friction falls so steeply
            as motion starts that the smallest excursions grow, whatever the gains.
            """
        ),
    ),
    "prediction": (
        flow(
            """
            Friction takes energy out of every sine, so harmonic balance predicts no cycle for any law.
            For Coulomb friction that is right: by the algebra of the linear slip the stick positions
            shrink by the factor {ratio_1:.6f} from stick to stick (Armstrong-Hélouvry & Amin 1996).
            For static + Coulomb friction it is wrong, every stabilising controller hunts, here with
            d = {algebra_2:.8f} m; and for the Stribeck curve it is wrong as well.
            """
        ),
    ),
    "experiment": (
        flow(
            """
            Five seconds of hunting, computed exactly, with noise added to the position, serve as a
            measurement. The exact model, stick and slip included, is fitted to it.
            """
        ),
    ),
    "relative": (
        flow(
            """
            LuGre replaces the set at rest by bristles, here of stiffness 1e5 N/m and damping 316 N s/m. Far
            from the end of hunting its cycles are some per cent smaller. Where hunting ends it is wrong in
            kind: rest attracts in LuGre for every exponent, because the bristles creep back where dry
            friction holds. For β = 2 its branch has the fold at P = {relative_fold_2:.4f} N/m in place of
            {fold_2:.4f}.
            """
        ),
        flow(
            """
            Its other branches end in a fold as well: at P = {relative_fold_1:.4f} for β = 1,
            where the inclusion has no fold and hunts from every start up to {change_1:.4f}; and
            at {relative_fold_0_5:.4f} for β = 0.5, where the inclusion hunts at every gain
            computed. LuGre would call those gains safe.
            """
        ),
    ),
}
