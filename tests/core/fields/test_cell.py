import jax
import jax.numpy as jnp
import numpy as np
import pytest

from core.fields.cell import blend


def test_the_transpose_of_the_blend_is_its_adjoint_where_points_share_vertices():
    rng = np.random.default_rng(0)
    with jax.enable_x64(True):
        values = jnp.asarray(rng.normal(size=(3, 4, 5)))
        index = jnp.asarray(rng.integers(0, [2, 3, 4], size=(60, 3)), jnp.int32)
        x, y, z = jnp.asarray(rng.uniform(size=(3, 60)))
        bars = jnp.asarray(rng.normal(size=(4, 60)))

        (value, slopes), pull_back = jax.vjp(lambda v: blend(v, index, (x, y, z)), values)
        back = pull_back((bars[0], (bars[1], bars[2], bars[3])))[0]
        forward = float(jnp.vdot(bars, jnp.stack([value, *slopes])))

    # <bars, A values> = <A^T bars, values>, to the rounding of float64.
    assert float(np.vdot(back, values)) == pytest.approx(forward, rel=1e-12)
