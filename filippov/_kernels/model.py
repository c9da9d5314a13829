"""What every compiled system provides to the loop: the interface, with a trivial system behind it.

The kernel files import these names so that they read and check as ordinary modules. A compiled unit is the
generated source of one system, which defines the same names, followed by the text of the kernel files
(see `build`). The trivial system is x' = 0 without a surface.

N, M, P: numbers of states, surfaces, and parameters with what is derived from them.
ROLE[i], LINEAR[i], WIDTH[i]: what surface i is, whether its guard is linear in (t, x), and the half width of
its hysteresis. AFFINE: the field is jointly affine in the signs. DENSE: powers of the dense output.
"""

import numpy as np
from numba import njit

N, M, P = 1, 1, 1
AFFINE = True
STAGES, EXTRA, DEGREE_DENSE = 13, 3, 7
END_IN_ERROR = False
ROLE = np.zeros(1, dtype=np.int64)
LINEAR = np.ones(1, dtype=np.bool_)
WIDTH = np.zeros(1)
ALL_LINEAR = True
ORDER = 8
DENSE = np.zeros((16, 8))

kernel = njit(cache=True, error_model="numpy")


@kernel
def rhs(t, x, p, s, m, out, ctx):
    """The field at signs s (every entry +1 or -1) with |h_i| = m_i h_i; nonzero return: the user's code failed."""
    out[0] = 0.0
    return 0


@kernel
def guards(t, x, p, m, out, ctx):
    """The switching functions h_i."""
    out[0] = 1.0
    return 0


@kernel
def gradients(t, x, p, m, g, gt, ctx):
    """Partial derivatives of every h_i by x (rows of g) and by t."""
    g[0, 0], gt[0] = 1.0, 0.0
    return 0


@kernel
def radii(t, x, p, out, ctx):
    """Lower and upper end of the set of s_i at h_i = 0, in columns 0 and 1."""
    out[0, 0], out[0, 1] = -1.0, 1.0
    return 0


@kernel
def stages(t, x, p, m, step, k, y, ws, ctx):
    """Stages from k[0] on, all but the one at the end of the step; leaves that end in y."""
    return 0


@kernel
def extra_stages(t, x, p, m, step, k, y, ws, ctx):
    """The stages that only the dense output needs."""
    return 0


@kernel
def error_terms(k, i):
    """The two embedded error estimates of component i, before the factor of the step."""
    return 0.0, 0.0
