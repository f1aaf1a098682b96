import dataclasses

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from calibration.adjustment import Sighting
from calibration.advice import advise, coverage
from calibration.board import Chessboard
from calibration.errors import TooFewViewsError
from calibration.intrinsics import fit_intrinsics
from core.geometry import Optics, looking_along_y
from core.lens import has_direction
from tests.calibration.practice import STANDS, project, rig, standing

BOARD = Chessboard(11, 8, 0.06)


def sightings_of(optics: Optics, noise_px: float, stands=STANDS, seed: int = 0) -> tuple[Sighting, ...]:
    """Board points projected without pictures, with Gaussian noise."""
    rng = np.random.default_rng(seed)
    points_m = BOARD.points_m
    seen = []
    for number, stand in enumerate(stands):
        sheet = standing(BOARD, *stand)
        world = sheet.position_m + (points_m[:, :2] + 2 * BOARD.square_m) @ sheet.world_from_sheet[:, :2].T
        seen.append(
            Sighting(0, number, points_m, project(optics, world) + rng.normal(0, noise_px, (len(world), 2)))
        )
    return tuple(seen)


def test_exact_points_give_exact_intrinsics_also_with_the_principal_point_off_the_panel():
    _, projector = rig()
    fit = fit_intrinsics(sightings_of(projector, 0.0), (1280, 800), offset_lens=True)

    # The minimum is found to rounding: there is no noise.
    assert fit.rms_px < 1e-6
    np.testing.assert_allclose(fit.device.intrinsics[:2], projector.focal_px, rtol=1e-6)
    np.testing.assert_allclose(fit.device.intrinsics[2:4], projector.principal_px, rtol=1e-6)
    assert projector.principal_px[1] > projector.height_px


def test_the_distortion_order_is_the_lowest_that_the_residuals_justify():
    camera, _ = rig()
    plain = dataclasses.replace(camera, distortion=(0.0, 0.0, 0.0, 0.0, 0.0))
    radial = dataclasses.replace(camera, distortion=(-0.2, 0.0, 0.0, 0.0, 0.0))
    tangential = dataclasses.replace(camera, distortion=(-0.2, 0.1, 0.004, -0.003, 0.0))

    models = [fit_intrinsics(sightings_of(o, 0.05), (1280, 1024)).model for o in (plain, radial, tangential)]

    assert models == ["none", "k1", "k1 k2 p1 p2"]


def within(camera: Optics, reach: float, seed: int) -> tuple[Sighting, ...]:
    """Twelve boards in the middle of the picture, by this part of its size, with noise of 0.05 px."""
    rng, size_px = np.random.default_rng(seed), np.array([camera.width_px, camera.height_px])
    points_m = BOARD.points_m - BOARD.points_m.mean(axis=0)
    seen: list[Sighting] = []
    while len(seen) < 12:
        turn = Rotation.from_rotvec(rng.uniform(-0.5, 0.5, 3)).as_matrix()
        z_m = rng.uniform(0.6, 1.2)
        across_m = rng.uniform(-0.7, 0.7, 2) * reach * z_m * size_px / 2 / camera.focal_px
        pixels = project(camera, (points_m @ turn.T + [*across_m, z_m]) @ camera.rotation)
        if np.abs(pixels / size_px - 0.5).max() < reach / 2:
            seen.append(Sighting(0, len(seen), points_m, pixels + rng.normal(0, 0.05, pixels.shape)))
    return tuple(seen)


def wide(k1: float, k2: float, k3: float) -> Optics:
    plain = looking_along_y(position_m=(0.0, 0.0, 0.0), width_px=1280, height_px=1024, focal_px=900.0)
    return dataclasses.replace(plain, distortion=(k1, k2, 0.0, 0.0, k3))


def test_a_distortion_that_turns_back_within_the_picture_is_passed_over():
    camera = wide(-0.35, 0.14, -0.025)
    corner = np.array([[0.0, 0.0]])
    passed_over = 0
    for seed in range(4):
        seen = within(camera, 0.62, seed)
        fit = fit_intrinsics(seen, (1280, 1024))
        assert has_direction(fit.device.matrix, fit.device.intrinsics[4:], corner).all()
        highest = fit_intrinsics(seen, (1280, 1024), models=("k1 k2", "k1 k2 p1 p2 k3"))
        passed_over += highest.model == "k1 k2"
        assert fit.rms_px < 1.1 * min(fit.rms_by_model_px.values())
    assert passed_over


def test_boards_in_the_middle_alone_of_a_lens_that_needs_more_ask_for_the_corners():
    # Of these two orders one is far off and the other turns back at 0.7 of a corner's distance.
    with pytest.raises(TooFewViewsError, match="Add views with the board in these corners"):
        fit_intrinsics(within(wide(-0.6, 0.0, 0.0), 0.6, 0), (1280, 1024), models=("none", "k1"))


def test_standard_deviations_predict_the_scatter():
    camera, _ = rig()
    camera = dataclasses.replace(camera, distortion=(-0.2, 0.0, 0.0, 0.0, 0.0))
    fits = [
        fit_intrinsics(sightings_of(camera, 0.1, STANDS[:6], seed), (1280, 1024), models=("k1",))
        for seed in range(12)
    ]
    off = np.array([f.device.intrinsics[:4] - [*camera.focal_px, *camera.principal_px] for f in fits])
    predicted = np.mean([f.std[:4] for f in fits], axis=0)

    # 12 draws: a sample's rms lies within 0.5 to 1.6 of its deviation with 99 % per parameter.
    ratio = np.sqrt(np.mean(off**2, axis=0)) / predicted
    assert ratio.min() > 0.5
    assert ratio.max() < 1.6


def test_wild_points_are_left_out_and_counted():
    camera, _ = rig()
    seen = list(sightings_of(camera, 0.05))
    pixels = seen[2].pixels_px.copy()
    pixels[:3] += 8.0
    seen[2] = dataclasses.replace(seen[2], pixels_px=pixels)

    fit = fit_intrinsics(tuple(seen), (1280, 1024))

    assert fit.outliers >= 3
    assert fit.device.intrinsics[0] == pytest.approx(camera.focal_px[0], rel=1e-3)
    assert fit.all_points_rms_px > 2 * fit.rms_px


def test_poor_sets_of_views_get_the_advice_that_fits():
    camera, _ = rig()
    straight = tuple(((x, 2.6, 1.2), (0.0, t, 0.0)) for x, t in ((-0.1, 20), (0.0, 30), (0.0, 30), (0.1, 25)))
    fit = fit_intrinsics(sightings_of(camera, 0.05, straight), (1280, 1024))
    names = ("a", "b", "c", "d")

    advice = " ".join(advise(fit, names, (1280, 1024)))

    assert "4 views; take 8 to 20" in advice
    assert "c repeats b" in advice
    assert "upper edge turned" in advice
    assert "lower edge turned" in advice
    # All were turned the same way about the vertical: exactly one of left and right is asked for.
    assert ("left edge turned" in advice) != ("right edge turned" in advice)
    assert "cover" in advice


def test_a_full_set_gets_no_advice_and_a_bad_view_is_named():
    camera, _ = rig()
    names = tuple(f"view {i}" for i in range(len(STANDS)))
    seen = list(sightings_of(camera, 0.05))
    rng = np.random.default_rng(4)
    seen[4] = dataclasses.replace(seen[4], pixels_px=seen[4].pixels_px + rng.normal(0, 0.3, (88, 2)))

    fit = fit_intrinsics(tuple(seen), (1280, 1024))

    assert next(a for a in advise(fit, names, (1280, 1024)) if "Retake" in a).startswith("Retake view 4")


def test_coverage_counts_the_cells_that_held_a_point():
    seen = coverage((np.array([[0.0, 0.0], [1279.0, 1023.0]]),), (1280, 1024))

    assert seen.sum() == 2
    assert seen[0, 0]
    assert seen[-1, -1]
