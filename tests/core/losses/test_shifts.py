import jax
import jax.numpy as jnp
import numpy as np
import pytest

from core.geometry import Box, looking_along_y
from core.losses.shifts import displacement_rows
from core.motion import motion_basis
from core.problem import ShiftMeasurement
from core.rays.operator import build
from core.scene import FixedTexture, Scene, View

SHAPE = (6, 5, 6)
SCENE = Scene(
    room=Box(lower_m=(0.0, 0.0, 0.0), upper_m=(3.0, 3.0, 3.0)),
    views=(
        View(camera=looking_along_y(position_m=(1.5, -27.0, 1.5), width_px=64, height_px=64, focal_px=550.0)),
    ),
    light=FixedTexture(),
)


def measured(drift_px, noise_px, seed=0):
    """Windows, the rows that they make, and the air that moved them."""
    rng = np.random.default_rng(seed)
    row, column = np.meshgrid(np.arange(9.5, 60, 3), np.arange(9.5, 60, 3), indexing="ij")
    centres = np.stack([column.ravel(), row.ravel()], axis=1)
    operator = build(SCENE, 0, centres, SHAPE)
    excess = jnp.asarray(1e-6 * rng.standard_normal(SHAPE), jnp.float32)
    basis = motion_basis(centres, SCENE.views[0].camera)
    exact = np.asarray(jax.jit(lambda o, e: o.apply(e))(operator, excess)) + basis @ np.asarray(drift_px)
    covariance = noise_px**2 * np.array([[1.0, 0.6], [0.6, 2.0]])
    noise = rng.standard_normal(exact.shape) @ np.linalg.cholesky(covariance).T
    information = np.broadcast_to(np.linalg.inv(covariance), (len(centres), 2, 2)).copy()
    shift = ShiftMeasurement(centres, exact + noise, information, 3)
    return displacement_rows(shift, operator, basis, 0.0), excess


def test_rows_of_the_true_air_are_white_noise_of_one_sigma():
    rows, excess = measured([0.0] * 6, 1e-4)
    errors = np.asarray(jax.jit(lambda r, e: r.errors(e, None))(rows, excess))
    # 578 numbers: the mean square scatters by sqrt(2 / 578) = 6 %; five sigma.
    assert float((errors**2).mean()) == pytest.approx(1.0, abs=0.3)
    assert abs(float(np.corrcoef(errors.T)[0, 1])) < 0.3


def test_a_drift_of_the_camera_is_recovered_as_six_numbers():
    drift = [0.02, -0.01, 0.003, 0.005, -0.02, 0.01]
    rows, excess = measured(drift, 1e-4)
    errors = jax.jit(lambda r, e, d: r.errors(e, d).ravel())
    still = np.asarray(errors(rows, excess, jnp.zeros(6)))
    slopes = np.stack([np.asarray(errors(rows, excess, jnp.eye(6)[k])) - still for k in range(6)], axis=1)
    found = np.linalg.lstsq(slopes, -still)[0]
    # A turn and a sensor that is carried differ by a hundredth; what both do to the windows is known.
    motions = np.asarray(rows.motions)
    np.testing.assert_allclose(motions @ found, motions @ np.array(drift), atol=1e-4)


def test_a_choice_of_rows_is_those_rows():
    rows, excess = measured([0.0] * 6, 1e-4)
    some = jnp.array([3, 0, 41])
    whole, part = jax.jit(lambda r, e: (r.errors(e, None), r.chosen(some).errors(e, None)))(rows, excess)
    np.testing.assert_allclose(part, np.asarray(whole)[np.asarray(some)], atol=2e-3)
