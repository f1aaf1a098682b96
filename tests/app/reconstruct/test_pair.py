"""A pair that cannot be compared is refused, and named for what it is."""

import re

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from app.errors import BadInputError
from app.experiment.capture_files import BurstImage
from app.experiment.captures import Capture
from app.reconstruct.pair import check_pair


def picture(seed: int = 0) -> np.ndarray:
    """A fine pattern, blurred as a lens does, with two percent of noise."""
    rng = np.random.default_rng(seed)
    blurred = gaussian_filter(rng.standard_normal((300, 400)), 1.2)
    return (0.4 + 0.1 * blurred / blurred.std()).astype(np.float32)


def capture(
    tmp_path, role: str, mean: np.ndarray, exposure_s: float | None = 0.02, noise: float = 0.004
) -> Capture:
    seen = mean + noise * np.random.default_rng(len(role)).standard_normal(mean.shape)
    image = BurstImage(seen.astype(np.float32), np.full(mean.shape, noise, np.float32), 1)
    settings = [{"name": "exposure_s", "granted": exposure_s}]
    return Capture(tmp_path / f"1-{role}", role, True, (image,), {"views": [{"settings": settings}]})


def checked(tmp_path, flow: np.ndarray, exposure_s: float | None = 0.02) -> None:
    pair = capture(tmp_path, "reference", picture()), capture(tmp_path, "flow", flow, exposure_s)
    check_pair(*pair, 0, np.full(flow.shape, 2 * 0.004**2))


def test_air_a_slow_lamp_and_a_person_before_a_third_of_the_wall_are_no_reason_to_refuse(tmp_path):
    still = picture()
    person = still.copy()
    person[60:, 130:260] = 0.2
    for flow in (still, np.roll(still, (1, -2), (0, 1)), 0.9 * still, person):
        checked(tmp_path, flow.astype(np.float32))


@pytest.mark.parametrize(("rows", "columns"), [(0, 20), (-12, 9)])
def test_a_camera_that_was_pushed_is_said_with_the_way_it_went(tmp_path, rows, columns):
    with pytest.raises(BadInputError, match=re.escape(f"moved by {columns:+d}, {rows:+d} px")):
        checked(tmp_path, np.roll(picture(), (rows, columns), (0, 1)))


def test_a_lamp_that_was_off_is_said_of_the_dark_picture(tmp_path):
    dark = picture() * 0.05
    with pytest.raises(
        BadInputError, match=r"1-flow: the flow picture has 5 % of the light of the reference"
    ):
        checked(tmp_path, dark.astype(np.float32))
    pair = capture(tmp_path, "reference", dark), capture(tmp_path, "flow", picture())
    with pytest.raises(BadInputError, match=r"1-reference: .* take the reference again"):
        check_pair(*pair, 0, np.full(dark.shape, 2 * 0.004**2))


def test_a_lens_out_of_focus_is_said_and_noise_is_no_sharpness(tmp_path):
    soft = gaussian_filter(picture(), 1.5)
    with pytest.raises(BadInputError, match=r"1-flow: .* fine structure .*out of focus"):
        checked(tmp_path, soft.astype(np.float32))
    noisy = [
        capture(tmp_path, role, one, noise=0.1) for role, one in (("reference", picture()), ("flow", soft))
    ]
    with pytest.raises(BadInputError, match="out of focus"):
        check_pair(*noisy, 0, np.full(soft.shape, 2 * 0.1**2))


def test_another_exposure_is_said_and_settings_that_nobody_told_are_not(tmp_path):
    with pytest.raises(BadInputError, match=r"exposure_s 0\.03, and the reference .* with 0\.02"):
        checked(tmp_path, picture(), exposure_s=0.03)
    checked(tmp_path, picture(), exposure_s=None)
