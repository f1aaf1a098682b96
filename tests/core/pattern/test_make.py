import numpy as np
import pytest

from core.pattern import decode_gray, gray_code, make_pattern, pattern_parts
from core.scene import CheckerPattern, DotPattern, WaveletPattern
from core.setting import SettingError


def power_between(image: np.ndarray, low: float, high: float) -> float:
    """Share of the power at radial frequencies [cycles / px] between two bounds."""
    power = np.abs(np.fft.fft2(image - image.mean())) ** 2
    frequency = np.hypot(np.fft.fftfreq(image.shape[0])[:, None], np.fft.fftfreq(image.shape[1])[None])
    return float(power[(frequency >= low) & (frequency < high)].sum() / power.sum())


def test_one_wavelet_band_holds_its_power_within_its_octave():
    image = make_pattern(WaveletPattern(bands=1, finest_px=4.0, contrast=0.1), 256, 256)

    # Cook & DeRose, figure 6: the quadratic B-spline leaks about a tenth above and little below.
    assert power_between(image, 0.125, 0.25) > 0.75
    assert power_between(image, 0.0, 0.0625) < 2e-3


def test_wavelet_bands_share_the_power_octave_by_octave():
    image = make_pattern(WaveletPattern(bands=3, finest_px=4.0, contrast=0.1), 512, 512)

    shares = [power_between(image, f, 2 * f) for f in (0.03125, 0.0625, 0.125)]
    assert all(share == pytest.approx(1 / 3, abs=0.1) for share in shares)


def test_a_seed_reproduces_a_pattern_and_another_does_not():
    first, again, other = (make_pattern(WaveletPattern(seed=s), 40, 50) for s in (7, 7, 8))

    assert np.array_equal(first, again)
    assert np.corrcoef(first.ravel(), other.ravel())[0, 1] < 0.2


def test_wavelet_contrast_and_mean_are_as_asked():
    image = make_pattern(WaveletPattern(contrast=0.1), 256, 300)

    assert image.dtype == np.float32
    # Nothing clips at five standard deviations.
    assert float(image.mean()) == pytest.approx(0.5, abs=1e-4)
    assert float(image.std()) == pytest.approx(0.1, rel=1e-3)


def test_dots_cover_what_was_asked():
    image = make_pattern(DotPattern(diameter_px=5.0, coverage=0.4), 400, 500)

    assert float(1 - image.mean()) == pytest.approx(0.4, abs=0.02)


def test_checkerboard_alternates():
    image = make_pattern(CheckerPattern(square_px=3.0), 12, 9)

    assert image[[0, 0, 3, 3], [0, 3, 0, 3]].tolist() == [0, 1, 1, 0]


def test_gray_code_names_every_projector_pixel():
    rows, cols = 11, 20
    images = gray_code(rows, cols)

    row, col = decode_gray(images.astype(float), rows, cols)

    assert np.array_equal(row, np.repeat(np.arange(rows)[:, None], cols, 1))
    assert np.array_equal(col, np.repeat(np.arange(cols)[None], rows, 0))
    stripes = images[0::2][:5].astype(int)
    changes = np.abs(np.diff(stripes[:, 0], axis=1)).sum(0)
    assert np.all(changes == 255)


@pytest.mark.parametrize(
    ("pattern", "hint"),
    [(WaveletPattern(finest_px=1.0), "finest_px"), (DotPattern(diameter_px=0.2), "diameter_px")],
)
def test_features_below_a_pixel_are_refused(pattern, hint):
    with pytest.raises(SettingError, match=hint):
        make_pattern(pattern, 32, 32)


@pytest.mark.parametrize(
    "pattern",
    [
        WaveletPattern(seed=3, finest_px=5.0),
        DotPattern(seed=2, diameter_px=3.5),
        CheckerPattern(square_px=3.7),
    ],
)
def test_rectangles_put_together_are_the_whole(pattern, monkeypatch):
    monkeypatch.setattr("core.pattern.wavelet._STRIP_PIXELS", 1000)
    rows, cols = 157, 211
    whole, part = make_pattern(pattern, rows, cols), pattern_parts(pattern, rows, cols)
    for row in (slice(0, 40), slice(33, 157)):
        for col in (slice(0, 101), slice(101, 211)):
            np.testing.assert_allclose(part(row, col), whole[row, col], atol=1e-6)
