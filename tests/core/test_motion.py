"""A motion of the camera that nobody knows: what it hides is taken out of measured and predicted shifts alike."""

from dataclasses import replace

import jax.numpy as jnp
import numpy as np
import pytest

from core.drift import nearly_still
from core.estimate.observation import observations
from core.geometry import looking_along_y, rotation_matrix
from core.lens import on_plane, seen_at
from core.motion import CameraMotion, motion_basis, without_motion
from core.problem import Problem, ShiftMeasurement
from core.solve.draft.draft import solve_draft
from core.solve.grid.grid import GridSettings, initial_unknowns
from core.solve.nondimensional import frame_of
from core.solve.regime import DataModel, image_loss
from tests.core.solve.test_level import SCENE, measured  # noqa: F401

SIZE_PX = (200, 150)
# A wide lens with barrel distortion.
OPTICS = replace(
    looking_along_y(position_m=(0.0, 0.0, 0.0), width_px=200, height_px=150, focal_px=160.0),
    distortion=(-0.1, 0.03, 1e-3, -5e-4, 0.0),
)
# A mount that creeps and turns by 1 px, 0.3 px of roll, and a lens that breathes by 0.1 px.
ROOT_PX = np.diag([1.0, 1.0, 0.1, 0.3, 1.0, 1.0])
CREEP_PX = np.array([0.3, -0.1, 0.05, 0.2, 0.4, -0.3])


def test_the_six_motions_are_what_a_camera_that_moves_does():
    rays = np.random.default_rng(0).uniform(-0.5, 0.5, (40, 2))
    before, (fx, fy) = seen_at(OPTICS, rays), OPTICS.focal_px
    ray = np.column_stack([rays, np.ones(len(rays))])

    def turned(x_px: float, y_px: float, roll_px: float) -> np.ndarray:
        away = ray @ rotation_matrix((-y_px / fy, x_px / fx, roll_px / 100.0)).T
        return seen_at(OPTICS, away[:, :2] / away[:, 2:])

    longer = replace(OPTICS, focal_px=(1.0002 * fx, 1.0002 * fy))
    carried = replace(OPTICS, principal_px=tuple(np.add(OPTICS.principal_px, (0.02, 0.01))))
    for after, motion_px in (
        (seen_at(carried, rays), [0.02, 0.01, 0, 0, 0, 0]),
        (seen_at(longer, rays), [0, 0, 0.02, 0, 0, 0]),
        (turned(0.0, 0.0, 0.02), [0, 0, 0, 0.02, 0, 0]),
        (turned(0.02, -0.01, 0.0), [0, 0, 0, 0, 0.02, -0.01]),
    ):
        found = motion_basis(before, OPTICS) @ np.array(motion_px)
        np.testing.assert_allclose(after - before, found, atol=2e-5)
    np.testing.assert_allclose(on_plane(OPTICS, before), rays, atol=1e-12)


def windows(count=60, seed=0):
    rng = np.random.default_rng(seed)
    centres = rng.uniform(0, SIZE_PX, (count, 2))
    half = rng.standard_normal((count, 2, 2))
    return rng, centres, half @ half.transpose(0, 2, 1) + np.eye(2)


def test_the_sum_of_squares_is_that_of_the_full_covariance():
    rng, centres, information = windows()
    motions = CameraMotion(OPTICS, ROOT_PX).at(centres)
    still, left = without_motion(motions, information), rng.standard_normal(centres.shape)
    moved = still.apply(left)
    found = np.einsum("wa,wab,wb->", moved, information, moved)
    covariance = np.zeros((120, 120))
    for n, block in enumerate(np.linalg.inv(information)):
        covariance[2 * n : 2 * n + 2, 2 * n : 2 * n + 2] = block
    together = motions.reshape(120, 6)
    covariance += together @ together.T
    assert found == pytest.approx(left.ravel() @ np.linalg.solve(covariance, left.ravel()), rel=1e-9)


def test_the_transpose_is_the_transpose_and_windows_that_know_nothing_move_no_other():
    rng, centres, information = windows()
    information[::3] = 0.0
    still = without_motion(CameraMotion(OPTICS, ROOT_PX).at(centres), information)
    a, b = rng.standard_normal((2, *centres.shape))
    assert np.sum(still.apply(a) * b) == pytest.approx(np.sum(a * still.transpose(b)))
    wild = a.copy()
    wild[::3] = 1e6
    np.testing.assert_allclose(still.apply(wild)[1::3], still.apply(a)[1::3])


def crept(shift: ShiftMeasurement, amount: float) -> ShiftMeasurement:
    moved = motion_basis(shift.centres_px, OPTICS) @ (amount * CREEP_PX)
    motion = CameraMotion(OPTICS, ROOT_PX)
    return replace(shift, displacement_px=shift.displacement_px + moved, motion=motion)


def test_the_size_of_the_shifts_is_judged_without_the_creep_also_beside_a_wall_that_moved_far(measured):  # noqa: F811
    far = measured.displacement_px.copy()
    far[:20] += 3.0
    seen = nearly_still(crept(replace(measured, displacement_px=far), 1.0)).displacement_px
    # Air 0.2 K/m warmer upwards moves the picture like a mount: nothing is left of it but what is curved.
    assert np.abs(seen[20:]).max() < 0.02 * np.abs(CREEP_PX).max()
    assert np.abs(seen[:20]).min() > 2.5


def test_a_creep_of_half_a_pixel_changes_no_draft(measured):  # noqa: F811
    drafts = [solve_draft(Problem(SCENE, (crept(measured, amount),))) for amount in (0.0, 1.0)]
    rise_k = np.ptp(drafts[0].temperature_k)
    apart_k = np.abs(drafts[0].temperature_k - drafts[1].temperature_k).max()
    assert apart_k < 0.02 * rise_k


def test_what_a_room_is_compared_with_knows_nothing_of_the_creep(measured):  # noqa: F811
    vertices = (9, 9, 9)
    data = observations(Problem(SCENE, (crept(measured, 1.0),)), vertices)
    as_it_is = observations(Problem(SCENE, (crept(measured, 0.0),)), vertices).values()[0]
    values, variance, kinds = data.values()
    off = data.unshared(values - as_it_is, variance)[kinds == 0]
    assert np.abs(off).max() < 1e-3 * np.abs(CREEP_PX).max()
    # Nor does a room's prediction: of a linear profile nothing is left.
    index = SCENE.air.excess_refractivity(jnp.broadcast_to(jnp.linspace(0.0, 0.6, 9), vertices))
    linear = np.zeros(len(values))
    linear[kinds == 0] = data.shifts[0].predicted(index).ravel()
    assert np.abs(data.unshared(linear, variance)).max() < 0.05 * np.abs(linear).max()


def test_a_grid_s_loss_has_the_creep_as_unknowns(measured):  # noqa: F811
    problem = Problem(SCENE, (crept(measured, 1.0),))
    frame = frame_of(problem)
    unknowns = initial_unknowns(problem, frame, GridSettings(cells=8, coarsest=8))
    assert unknowns.drift is not None
    (view,) = image_loss(problem, frame, 1.0, DataModel(), (9, 9, 9)).views
    still, index = jnp.zeros(6), jnp.zeros((9, 9, 9))
    slopes = np.stack(
        [
            np.asarray(view.errors(index, still.at[n].set(1.0)) - view.errors(index, still)).ravel()
            for n in range(6)
        ]
    )
    # One unit moves the windows by about as much as they moved.
    assert np.all(np.abs(slopes).max(1) > 0.01 * float(jnp.abs(view.errors(index, still)).max()))
