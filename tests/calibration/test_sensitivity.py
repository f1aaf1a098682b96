import jax
import jax.numpy as jnp
import numpy as np
import pytest

from calibration.bundle import CalibratedOptics, given_bundle
from calibration.sensitivity import shift_uncertainty
from calibration.simulated_pictures import rays_of
from calibration.world import shifted
from core.rays.optics import pinhole
from tests.calibration.practice import project, rig

DATE = "2026-03-01T12:00:00+00:00"


def bundle_of(scale: float = 0.05, **known):
    camera, projector = rig(scale)
    return given_bundle(
        date=DATE, cameras={"camera": camera}, projector=projector, back_wall_y_m=3.0, **known
    )


def test_a_pixel_s_ray_is_opencv_s():
    optics = bundle_of().camera().optics
    with jax.enable_x64(True):
        direction = np.asarray(pinhole(optics).direction(jnp.asarray([7.0, 3.0])))
    # OpenCV's iteration and our Newton's method agree on the same lens.
    expected = rays_of(optics, np.array([[7.0, 3.0]]))[0]
    np.testing.assert_allclose(direction, expected / np.linalg.norm(expected), atol=1e-9)


def test_a_wall_point_s_panel_pixel_is_opencv_s_and_has_its_derivative():
    bundle = bundle_of()
    projector = rig(0.05)[1]
    point = np.array([0.2, 3.0, 1.1])
    with jax.enable_x64(True):
        to_panel = pinhole(bundle.projector.optics).project
        found = np.asarray(to_panel(jnp.asarray(point)))
        slope = np.asarray(jax.jacfwd(to_panel)(jnp.asarray(point)))

    np.testing.assert_allclose(found, project(projector, point[None])[0], rtol=1e-9)
    step = np.array([1e-6, 0.0, 0.0])
    ahead, behind = (project(projector, (point + s * step)[None])[0] for s in (1, -1))
    np.testing.assert_allclose(slope[:, 0], (ahead - behind) / 2e-6, rtol=1e-5)


def test_the_shift_s_uncertainty_is_that_of_the_distances():
    bundle = bundle_of()
    covariance = np.zeros((15, 15))
    # The camera's y is known to 3 mm, nothing else errs.
    covariance[13, 13] = 0.003**2
    known = CalibratedOptics("camera", bundle.camera().optics, tuple(map(tuple, covariance.tolist())))

    found = shift_uncertainty(bundle.with_camera(known), steps=5)

    # A turn at a fixed place moves the wall point by a fixed length, seen from 3 m: 0.1 % of the shift.
    assert np.median(found.shift_std_per_px) == pytest.approx(1e-3, rel=0.1)
    # The pattern's place errs by the baseline's part of it: 0.55 m / 3 m * 3 mm / 3 m of the focal length.
    exact = shift_uncertainty(bundle, steps=5)
    assert exact.shift_std_per_px.max() == 0.0
    assert exact.placement_std_px.max() == 0.0


def test_placement_agrees_with_moving_the_camera():
    bundle = bundle_of(0.5)
    change = np.zeros(15)
    change[[2, 10, 12]] = 0.3, 2e-4, 1e-3
    covariance = np.outer(change, change)
    camera = bundle.camera().optics
    known = CalibratedOptics("camera", camera, tuple(map(tuple, covariance.tolist())))
    found = shift_uncertainty(bundle.with_camera(known), steps=3)

    # One direction of error only: its deviation is the place's change when the camera is moved by it.
    pixel = found.pixels_px[4]

    def panel(optics, at):
        lens = pinhole(optics)
        direction = lens.direction(jnp.asarray(at))
        point = lens.position_m + direction * (3.0 - lens.position_m[1]) / direction[1]
        return np.asarray(pinhole(bundle.projector.optics).project(point))

    with jax.enable_x64(True):
        off = panel(shifted(camera, change), pixel) - panel(camera, pixel)
        slope = np.stack(
            [(panel(camera, pixel + d) - panel(camera, pixel - d)) / 0.02 for d in 0.01 * np.eye(2)], axis=1
        )
    expected = np.abs(np.linalg.solve(slope, off)).max()
    assert found.placement_std_px[4] == pytest.approx(expected, rel=1e-2)
