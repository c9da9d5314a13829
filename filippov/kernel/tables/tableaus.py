"""Butcher tableaus with their continuous extensions, as sparse rows {stage: coefficient}.

DOP853: Hairer, Norsett & Wanner 1993, section II.5 and their Fortran code of that name (order 8, error
estimates of orders 5 and 3, dense output of order 7). DP5: Dormand & Prince 1980 (order 5, error estimate of
order 4) with the quartic interpolant of Shampine 1986. Radau: Radau IIA with three stages, Hairer & Wanner
1996, section IV.8 (order 5, error estimate of order 3, collocation polynomial of degree 3).

Stage numbers count from 0; the last of the main stages is the field at the end of the step.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from filippov.kernel.tables.radau_tables import dense_rows

Row = dict[int, float]

_DOP853_A = (
    {
        0: 0.05260015195876773,
    },
    {
        0: 0.0197250569845379, 1: 0.0591751709536137,
    },
    {
        0: 0.02958758547680685, 2: 0.08876275643042054,
    },
    {
        0: 0.2413651341592667, 2: -0.8845494793282861, 3: 0.924834003261792,
    },
    {
        0: 0.037037037037037035, 3: 0.17082860872947386, 4: 0.12546768756682242,
    },
    {
        0: 0.037109375, 3: 0.17025221101954405, 4: 0.06021653898045596, 5: -0.017578125,
    },
    {
        0: 0.03709200011850479, 3: 0.17038392571223998, 4: 0.10726203044637328, 5: -0.015319437748624402,
        6: 0.008273789163814023,
    },
    {
        0: 0.6241109587160757, 3: -3.3608926294469414, 4: -0.868219346841726, 5: 27.59209969944671,
        6: 20.154067550477894, 7: -43.48988418106996,
    },
    {
        0: 0.47766253643826434, 3: -2.4881146199716677, 4: -0.590290826836843, 5: 21.230051448181193,
        6: 15.279233632882423, 7: -33.28821096898486, 8: -0.020331201708508627,
    },
    {
        0: -0.9371424300859873, 3: 5.186372428844064, 4: 1.0914373489967295, 5: -8.149787010746927,
        6: -18.52006565999696, 7: 22.739487099350505, 8: 2.4936055526796523, 9: -3.0467644718982196,
    },
    {
        0: 2.273310147516538, 3: -10.53449546673725, 4: -2.0008720582248625, 5: -17.9589318631188,
        6: 27.94888452941996, 7: -2.8589982771350235, 8: -8.87285693353063, 9: 12.360567175794303,
        10: 0.6433927460157636,
    },
    {
        0: 0.054293734116568765, 5: 4.450312892752409, 6: 1.8915178993145003, 7: -5.801203960010585,
        8: 0.3111643669578199, 9: -0.1521609496625161, 10: 0.20136540080403034, 11: 0.04471061572777259,
    },
)
_DOP853_C = (
    0.05260015195876773, 0.0789002279381516, 0.1183503419072274, 0.2816496580927726, 0.3333333333333333,
    0.25, 0.3076923076923077, 0.6512820512820513, 0.6, 0.8571428571428571, 1.0,
)
_DOP853_EXTRA = (
    {
        0: 0.056167502283047954, 6: 0.25350021021662483, 7: -0.2462390374708025, 8: -0.12419142326381637,
        9: 0.15329179827876568, 10: 0.00820105229563469, 11: 0.007567897660545699, 12: -0.008298,
    },
    {
        0: 0.03183464816350214, 5: 0.028300909672366776, 6: 0.053541988307438566, 7: -0.05492374857139099,
        10: -0.00010834732869724932, 11: 0.0003825710908356584, 12: -0.00034046500868740456,
        13: 0.1413124436746325,
    },
    {
        0: -0.42889630158379194, 5: -4.697621415361164, 6: 7.683421196062599, 7: 4.06898981839711,
        8: 0.3567271874552811, 12: -0.0013990241651590145, 13: 2.9475147891527724, 14: -9.15095847217987,
    },
)
_DOP853_EXTRA_C = (
    0.1, 0.2, 0.7777777777777778,
)
_DOP853_ERRORS = (
    {
        0: 0.01312004499419488, 5: -1.2251564463762044, 6: -0.4957589496572502, 7: 1.6643771824549864,
        8: -0.35032884874997366, 9: 0.3341791187130175, 10: 0.08192320648511571, 11: -0.022355307863886294,
    },
    {
        0: -0.18980075407240762, 5: 4.450312892752409, 6: 1.8915178993145003, 7: -5.801203960010585,
        8: -0.4226823213237919, 9: -0.1521609496625161, 10: 0.20136540080403034, 11: 0.02265179219836082,
    },
)
_DOP853_D = (
    {
        0: -8.428938276109013, 5: 0.5667149535193777, 6: -3.0689499459498917, 7: 2.38466765651207,
        8: 2.117034582445028, 9: -0.871391583777973, 10: 2.2404374302607883, 11: 0.6315787787694688,
        12: -0.08899033645133331, 13: 18.148505520854727, 14: -9.194632392478356, 15: -4.436036387594894,
    },
    {
        0: 10.427508642579134, 5: 242.28349177525817, 6: 165.20045171727028, 7: -374.5467547226902,
        8: -22.113666853125306, 9: 7.733432668472264, 10: -30.674084731089398, 11: -9.332130526430229,
        12: 15.697238121770845, 13: -31.139403219565178, 14: -9.35292435884448, 15: 35.81684148639408,
    },
    {
        0: 19.985053242002433, 5: -387.0373087493518, 6: -189.17813819516758, 7: 527.8081592054236,
        8: -11.57390253995963, 9: 6.8812326946963, 10: -1.0006050966910838, 11: 0.7777137798053443,
        12: -2.778205752353508, 13: -60.19669523126412, 14: 84.32040550667716, 15: 11.99229113618279,
    },
    {
        0: -25.69393346270375, 5: -154.18974869023643, 6: -231.5293791760455, 7: 357.6391179106141,
        8: 93.40532418362432, 9: -37.45832313645163, 10: 104.0996495089623, 11: 29.8402934266605,
        12: -43.53345659001114, 13: 96.32455395918828, 14: -39.17726167561544, 15: -149.72683625798564,
    },
)

_DP5_A = (
    {
        0: 0.2,
    },
    {
        0: 0.075, 1: 0.225,
    },
    {
        0: 0.9777777777777777, 1: -3.7333333333333334, 2: 3.5555555555555554,
    },
    {
        0: 2.9525986892242035, 1: -11.595793324188385, 2: 9.822892851699436, 3: -0.2908093278463649,
    },
    {
        0: 2.8462752525252526, 1: -10.757575757575758, 2: 8.906422717743473, 3: 0.2784090909090909,
        4: -0.2735313036020583,
    },
    {
        0: 0.09114583333333333, 2: 0.44923629829290207, 3: 0.6510416666666666, 4: -0.322376179245283,
        5: 0.13095238095238096,
    },
)
_DP5_C = (
    0.2, 0.3, 0.8, 0.8888888888888888, 1.0,
)
_DP5_ERRORS = (
    {
        0: -0.0012326388888888888, 2: 0.0042527702905061394, 3: -0.03697916666666667,
        4: 0.05086379716981132, 5: -0.0419047619047619, 6: 0.025,
    },
)
_DP5_DENSE: tuple[Row, ...] = (
    {
        0: 1.0, 1: -2.8535800653862835, 2: 3.0717434641059005, 3: -1.1270175653862835,
    },
    {

    },
    {
        1: 4.023133379230305, 2: -6.249321565289, 3: 2.675424484351598,
    },
    {
        1: -3.7324019615885042, 2: 10.068970589843675, 3: -5.685526961588504,
    },
    {
        1: 2.5548038301849423, 2: -6.399112377351017, 3: 3.5219323679207912,
    },
    {
        1: -1.3744241142186024, 2: 3.272657752246729, 3: -1.7672812570757455,
    },
    {
        1: 1.3824689317781436, 2: -3.764937863556287, 3: 2.382468931778144,
    },
)


@dataclass(frozen=True)
class Tableau:
    """An explicit pair: main rows (the last is the step itself), extra rows of the dense output, error rows.

    dense[stage][power]: x(theta) = x0 + step * sum_power theta**power sum_stage dense[stage][power] k_stage.
    """

    name: str
    order: int
    main: tuple[Row, ...]
    main_nodes: tuple[float, ...]
    extra: tuple[Row, ...]
    extra_nodes: tuple[float, ...]
    errors: tuple[Row, ...]
    dense: tuple[tuple[float, ...], ...]

    @property
    def stages(self) -> int:
        """Main stages, with the field at the end of the step."""
        return len(self.main) + 1

    @property
    def end_in_error(self) -> bool:
        """Whether the error estimate needs the field at the end of the step."""
        return any(self.stages - 1 in row for row in self.errors)


def _times(a: list[float], b: list[float]) -> list[float]:
    out = [0.0] * (len(a) + len(b) - 1)
    for i, u in enumerate(a):
        for j, v in enumerate(b):
            out[i + j] += u * v
    return out


def _dop853_dense() -> tuple[tuple[float, ...], ...]:
    """Powers of theta from the nested form of section II.6: theta and 1 - theta in turn, seven deep."""
    bases: list[list[float]] = []
    factor = [1.0]
    for depth in range(7):
        factor = _times(factor, [0.0, 1.0] if depth % 2 == 0 else [1.0, -1.0])
        bases.append(factor)
    step = _DOP853_A[-1]
    table = []
    for stage in range(16):
        end, begin = float(stage == 12), float(stage == 0)
        weight = step.get(stage, 0.0)
        parts = [weight, begin - weight, 2.0 * weight - end - begin]
        parts += [row.get(stage, 0.0) for row in _DOP853_D]
        powers = [0.0] * 8
        for part, basis in zip(parts, bases, strict=True):
            for power, value in enumerate(basis):
                powers[power] += part * value
        table.append(tuple(powers))
    return tuple(table)


def _dp5_dense() -> tuple[tuple[float, ...], ...]:
    return tuple(tuple([0.0] + [row.get(j, 0.0) for j in range(4)]) for row in _DP5_DENSE)


DOP853 = Tableau(
    "DOP853", 8, _DOP853_A, _DOP853_C, _DOP853_EXTRA, _DOP853_EXTRA_C, _DOP853_ERRORS, _dop853_dense()
)
DP5 = Tableau("DP5", 5, _DP5_A, _DP5_C, (), (), _DP5_ERRORS, _dp5_dense())


@dataclass(frozen=True)
class Collocation:
    """An implicit method whose stages are solved for together; `dense` is its collocation polynomial.

    Stages: the field at the start, those inside the step, and the field at the end, which closes the step.
    error_order: power of the step with which the local error estimate scales.
    """

    name: str
    order: int
    error_order: int
    dense: tuple[tuple[float, ...], ...]
    extra: tuple[Row, ...] = ()
    end_in_error: bool = False

    @property
    def stages(self) -> int:
        """Stages, with the fields at both ends of the step."""
        return len(self.dense)


@dataclass(frozen=True)
class Series:
    """Taylor's method: row j of its dense output is coefficient j of the field, times step**j; the last is 0.

    The last stage is the field at the end of the step, with which the polynomial's rate there is compared.
    """

    name: str
    order: int
    extra: tuple[Row, ...] = ()
    end_in_error: bool = True

    @property
    def stages(self) -> int:
        """Coefficients of the field, and the field at the end of the step."""
        return self.order + 1

    @property
    def dense(self) -> tuple[tuple[float, ...], ...]:
        """1 / (j + 1) for theta**(j + 1) in row j."""
        rows = [[0.0] * (self.order + 1) for _ in range(self.stages)]
        for j in range(self.order):
            rows[j][j + 1] = 1.0 / (j + 1)
        return tuple(tuple(row) for row in rows)


RADAU = Collocation("Radau", 5, 4, dense_rows())
Method = Tableau | Collocation | Series
TABLEAUS: dict[str, Method] = {method.name: method for method in (DOP853, DP5, RADAU)}
# What a user may choose.
INTEGRATORS = (*TABLEAUS, "Taylor")
# The available orders of Taylor's method: few, so that tolerances share units.
SERIES_ORDERS = (8, 10, 12, 14, 16, 18, 20)
TABLEAUS |= {f"Taylor{order}": Series(f"Taylor{order}", order) for order in SERIES_ORDERS}
# For evaluations of a system without a tolerance.
TABLEAUS["Taylor"] = Series("Taylor", 14)


def weighted(rows: Sequence[Sequence[float]]) -> list[int]:
    """The stages that have weights in a dense output, one row per stage."""
    return [stage for stage, row in enumerate(rows) if any(row)]


def for_tolerance(method: str, rtol: float) -> str:
    """The name of a method at a tolerance: Taylor's method of an order of about 4 - log10(rtol)."""
    if method != "Taylor":
        return method
    wanted = 4.0 - math.log10(rtol)
    return f"Taylor{next((order for order in SERIES_ORDERS if order >= wanted - 0.5), SERIES_ORDERS[-1])}"
