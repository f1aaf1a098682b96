"""A passive scalar on a found flow, at rest in time: finite volumes, first-order upwind, conserved exactly.

    sum over faces of (q c_upwind - D area / spacing (c_next - c)) = source        in every cell

Supply air brings none; air that leaves takes the cell's own, and nothing passes walls. D is the air's own diffusivity
and the eddies', nu_t = 0.03874 |u| l with the distance l from the nearest wall (Chen and Xu 1998), over a turbulent
Schmidt number of 0.85. Upwind fluxes smear as a further |u| spacing / 2 would.
"""

from collections.abc import Sequence
from typing import Any

import equinox as eqx
import numpy as np
from scipy import sparse
from scipy.sparse import linalg

from core.setting import SettingError
from core.ventilation.face_flow import Axis, Cells, FaceFlow

TURBULENT_SCHMIDT = 0.85
MOLECULAR_M2_S = 2.1e-5
TOLERANCE = 1e-8
# So many cells are solved for at once, without iterations.
_FEW = 2000
# Of an incomplete factorisation; the order and the pivots are those of a nearly symmetric matrix.
_FACTORS: dict[str, Any] = {
    "drop_tol": 3e-2, "fill_factor": 4.0, "permc_spec": "MMD_AT_PLUS_A", "diag_pivot_thresh": 0.0,
}  # fmt: skip


class Tracer(eqx.Module):
    """The discrete transport on one flow, ready for any source."""

    flow: FaceFlow
    matrix: sparse.csc_matrix
    factors: linalg.SuperLU

    def concentration(self, source: Cells) -> Cells:
        """The concentration at rest for a source in every cell [m3/s of the scalar]. Raises SettingError."""
        first = self.factors.solve(source.ravel())
        preconditioner = linalg.LinearOperator(self.matrix.shape, self.factors.solve)
        found, failed = linalg.bicgstab(
            self.matrix, source.ravel(), first, rtol=TOLERANCE, maxiter=500, M=preconditioner
        )
        if failed:
            raise SettingError(
                "The tracer's concentration was not found: the flow leaves a part of the room."
            )
        return found.reshape(source.shape)


def tracer(flow: FaceFlow, diffusivity_m2_s: Cells) -> Tracer:
    """The transport of a scalar by `flow` and `diffusivity_m2_s`."""
    matrix = _matrix(flow, diffusivity_m2_s)
    few = diffusivity_m2_s.size <= _FEW
    return Tracer(flow, matrix, linalg.splu(matrix) if few else linalg.spilu(matrix, **_FACTORS))


def eddy_diffusivity_m2_s(speed_m_s: Cells, axes_m: Sequence[Axis]) -> Cells:
    """Diffusivity of air and eddies by the zero-equation model (Chen and Xu 1998)."""
    near = [_from_wall_m(axis) for axis in axes_m]
    distance_m = np.minimum(np.minimum(near[0][:, None, None], near[1][:, None]), near[2])
    return MOLECULAR_M2_S + 0.03874 * speed_m_s * distance_m / TURBULENT_SCHMIDT


def _from_wall_m(axis_m: Axis) -> Axis:
    centres = 0.5 * (axis_m[1:] + axis_m[:-1])
    return np.minimum(centres - axis_m[0], axis_m[-1] - centres)


def _matrix(flow: FaceFlow, diffusivity_m2_s: Cells) -> sparse.csc_matrix:
    number = np.arange(diffusivity_m2_s.size).reshape(diffusivity_m2_s.shape)
    own = np.zeros(diffusivity_m2_s.shape)
    rows, columns, values = [], [], []
    for a, q in enumerate(flow.flow_m3_s):
        step = float(flow.axes_m[a][1] - flow.axes_m[a][0])
        low, high = (tuple(part if b == a else slice(None) for b in range(3)) for part in _SIDES)
        between = q[tuple(slice(1, -1) if b == a else slice(None) for b in range(3))]
        area = float(flow.volumes_m3[0, 0, 0]) / step
        spread = area / step * 0.5 * (diffusivity_m2_s[low] + diffusivity_m2_s[high])
        up, down = np.maximum(between, 0.0) + spread, np.maximum(-between, 0.0) + spread
        own[low] += up
        own[high] += down
        rows += [number[high].ravel(), number[low].ravel()]
        columns += [number[low].ravel(), number[high].ravel()]
        values += [-up.ravel(), -down.ravel()]
        for end, sign in ((0, -1.0), (-1, 1.0)):
            plane = tuple(end if b == a else slice(None) for b in range(3))
            own[plane] += np.maximum(sign * q[plane], 0.0)
    rows.append(number.ravel())
    columns.append(number.ravel())
    values.append(own.ravel())
    entries = (np.concatenate(values), (np.concatenate(rows), np.concatenate(columns)))
    return sparse.csc_matrix(entries, shape=(number.size, number.size))


_SIDES = (slice(None, -1), slice(1, None))
