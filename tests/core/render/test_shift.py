"""The pattern's shift at the paper's geometry, against a converged two-point solution in float64."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from core.fields import plume
from core.geometry import looking_along_y
from core.rays import NonlinearTracer
from core.rays.yardstick import exact_wall_shift_m
from core.render.irradiance import irradiance_factor
from core.render.pixel_geometry import pixel_geometry
from core.render.shift import aim, pattern_offset_px, wall_offset_m
from core.scene import ProjectedPattern, Scene, View
from tests.core.rays.scenes import AIR, N0, ROOM, rays_from, single, wall_points

EYE_M, LAMP_M = (0.85, -29.0, 1.5), (1.85, -29.0, 1.5)
offset = eqx.filter_jit(wall_offset_m)


def warm(peak_k: float):
    return plume(AIR, peak_k=jnp.asarray(peak_k), centre_m=(0.85, 0.0, 1.5), radius_m=0.25)


def lit_by(eye_m, lamp_m, points_m: np.ndarray) -> Scene:
    """A camera and a projector, each looking along y and seeing the whole wall."""
    stand_off_m = ROOM.upper_m[1] - eye_m[1]
    camera = looking_along_y(position_m=eye_m, width_px=4096, height_px=3072, focal_px=1000.0 * stand_off_m)
    lamp = looking_along_y(
        position_m=lamp_m, width_px=4096, height_px=3072, focal_px=900.0 * stand_off_m,
        principal_px=(2047.5 + 900.0 * (lamp_m[0] - 0.85), 1535.5),
    )  # fmt: skip
    return Scene(room=ROOM, views=(View(camera=camera),), light=ProjectedPattern(projector=lamp))


def pixels_of(scene: Scene, points_m: np.ndarray) -> np.ndarray:
    camera = scene.views[0].camera
    away = (points_m - np.array(camera.position_m)) / (ROOM.upper_m[1] - camera.position_m[1])
    return np.stack([away[:, 0], -away[:, 2]], 1) * camera.focal_px[0] + np.array(camera.principal_px)


def converged_offset_m(points_m: np.ndarray, peak_k: float) -> tuple[np.ndarray, np.ndarray]:
    """Camera's shift, and the aim point minus the wall point, by Picard steps until nothing moves."""
    seen_m = exact_wall_shift_m(rays_from(EYE_M, points_m), warm(peak_k), N0)
    found = np.zeros_like(seen_m)
    for _ in range(5):
        found = seen_m - exact_wall_shift_m(rays_from(LAMP_M, points_m + found), warm(peak_k), N0)
    return seen_m, found


def relative(found, exact) -> float:
    return float(np.linalg.norm(np.asarray(found) - exact) / np.linalg.norm(exact))


def test_one_picard_step_reaches_the_two_point_solution_and_the_projector_matters():
    points_m = wall_points(40)
    scene = lit_by(EYE_M, LAMP_M, points_m)
    geometry = pixel_geometry(scene, 0, pixels_of(scene, points_m))
    assert np.all(np.asarray(geometry.weight) > 0)

    for peak_k, bound in ((10.0, 1e-6), (1500.0, 1e-4)):
        with jax.enable_x64(True):
            seen_m, exact_m = converged_offset_m(points_m, peak_k)
        tracer = NonlinearTracer(64, N0)
        first, second = (offset(geometry, single(warm(peak_k)), tracer, k) for k in (1, 2))
        # Relative to the camera's own shift, the scale of everything that is subtracted.
        scale = np.linalg.norm(seen_m)
        assert np.linalg.norm(second - exact_m) < bound * scale
        assert np.linalg.norm(first - exact_m) < 5e-3 * scale
        # A model that bends the camera's ray alone is wrong by four times the signal.
        assert relative(seen_m, exact_m) > 4.0


def test_camera_and_projector_in_one_place_see_no_shift():
    points_m = wall_points(40)
    scene = lit_by(EYE_M, EYE_M, points_m)
    geometry = pixel_geometry(scene, 0, pixels_of(scene, points_m))

    for order in (1, 2):
        found_m = offset(geometry, single(warm(10.0)), NonlinearTracer(64, N0), order)
        assert np.abs(pattern_offset_px(geometry, found_m)).max() < 1e-6


def test_a_wide_baseline_shows_the_plume_twice_with_opposite_signs():
    # From 4 m away and 3 m apart, the narrow plume's two shadows on the wall are 1.5 m apart.
    hot = plume(AIR, peak_k=jnp.asarray(10.0), centre_m=(0.85, 0.0, 1.5), radius_m=0.1)
    line = np.stack([np.linspace(-1.1, 2.8, 157), np.full(157, 1.5), np.full(157, 1.5)], 1)
    scene = lit_by((2.35, -2.5, 1.5), (-0.65, -2.5, 1.5), line)
    geometry = pixel_geometry(scene, 0, pixels_of(scene, line))

    both = np.asarray(offset(geometry, single(hot), NonlinearTracer(64, N0), 1))[:, 0]

    tracer = NonlinearTracer(64, N0)
    seen = np.asarray(tracer.bend(geometry.camera, single(hot)).wall_shift_m)[:, 0]
    assert geometry.projector is not None
    lit = np.asarray(tracer.bend(geometry.projector, single(hot)).wall_shift_m)[:, 0]
    apart = np.abs(line[np.argmax(np.abs(seen)), 0] - line[np.argmax(np.abs(lit)), 0])
    assert apart > 1.0
    near_seen, near_lit = np.abs(seen) > 0.1 * np.abs(seen).max(), np.abs(lit) > 0.1 * np.abs(lit).max()
    assert not np.any(near_seen & near_lit)
    assert both[near_seen] == pytest.approx(seen[near_seen], rel=0.02)
    assert both[near_lit] == pytest.approx(-lit[near_lit], rel=0.02)


def test_refracted_light_on_the_wall_is_conserved():
    hot = plume(AIR, peak_k=jnp.asarray(1500.0), centre_m=(0.85, 0.0, 1.5), radius_m=0.08)
    # Around the plume's shadow, whose rim the light does not cross.
    x, z = np.meshgrid(np.linspace(0.3, 1.3, 81), np.linspace(0.6, 2.4, 73), indexing="ij")
    points_m = np.stack([x.ravel(), np.full(x.size, 1.5), z.ravel()], 1)
    scene = lit_by(EYE_M, LAMP_M, points_m)
    geometry = pixel_geometry(scene, 0, pixels_of(scene, points_m))
    tracer = NonlinearTracer(64, N0)
    assert geometry.projector is not None
    assert geometry.projector_range_m is not None
    aimed_m = jnp.zeros((x.size, 3), jnp.float32)
    for _ in range(4):
        rays = aim(geometry.projector, aimed_m, geometry.projector_range_m)
        aimed_m = -eqx.filter_jit(tracer.bend)(rays, single(hot)).wall_shift_m

    gain = np.asarray(eqx.filter_jit(irradiance_factor)(geometry, single(hot), tracer, aimed_m), float)

    # A lamp brighter in the middle: its light at w is what was aimed at a(w), times the gain.
    def lamp(x_m, z_m):
        return np.exp(-((x_m - 0.8) ** 2 + (z_m - 1.4) ** 2) / 0.02)

    aimed = np.asarray(aimed_m, float)
    still = lamp(points_m[:, 0], points_m[:, 2])
    bent = lamp(points_m[:, 0] + aimed[:, 0], points_m[:, 2] + aimed[:, 2])
    assert (bent * gain).sum() == pytest.approx(still.sum(), rel=1e-4)
    # Without the term the light would not be conserved, and it is not small here.
    assert abs(bent.sum() / still.sum() - 1) > 3e-4
    assert np.abs(gain - 1).max() > 5e-3
