"""The shift estimator beside scikit-image's on the same pairs: bias, scatter over the stated deviation, time.

    python -m tests.benchmarks.shift [--seeds 3] [--size 512]
    python -m tests.benchmarks.shift --photographed FOLDER

A band-limited texture (`period_px` to 40 px) is shifted exactly in the Fourier domain; the camera has a full
well of 10,000 electrons, 20 of read noise and 12 bits; windows of 32 px. One JSON line a pair and estimator. `bias`
is the mean shift found over the true one, less 1; `rms_z` the error over the stated standard deviation; `outliers`
the share of windows that are wrong by more than half a pixel. scikit-image states no deviation.

FOLDER has a photographed pair, `reference.tif` and `flow.tif`, and what PIVlab made of it, `u_piv.mat` and
`v_piv.mat` (windows of 16 px, 8 px apart). `rms_px` is then the difference from that, across and down, and `slope`
how much further the windows moved than PIVlab says, by how far they moved.
"""

import argparse
import json
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import tifffile
from scipy import io, ndimage
from scipy.interpolate import RegularGridInterpolator
from skimage.registration import optical_flow_ilk, phase_cross_correlation

from core.displacement import measure_shift, standard_deviation_px

WINDOW_PX, EDGE_PX = 32, 48
_PIV_PX = 16
_FULL_WELL_E, _READ_E, _STEPS = 1e4, 20.0, 4095
Found = tuple[np.ndarray, np.ndarray | None]


def texture(size: int, seed: int, period_px: float, shift_px: np.ndarray) -> np.ndarray:
    """A periodic random picture about 0.5, moved by (column, row) px."""
    fy, fx = np.fft.fftfreq(size)[:, None], np.fft.fftfreq(size)[None]
    fineness = np.hypot(fx, fy)
    noise = np.fft.fft2(np.random.default_rng(seed).standard_normal((size, size)))
    spectrum = noise * (fineness < 1 / period_px) * (fineness > 1 / 40)
    still = np.fft.ifft2(spectrum).real
    moved = np.fft.ifft2(spectrum * np.exp(-2j * np.pi * (fx * shift_px[0] + fy * shift_px[1]))).real
    return 0.5 + moved / (8 * still.std())


def pair(
    size: int, seed: int, period_px: float, frames: int, light: float, shift_px: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Reference, flow and the variance of their difference; `light` is the mean level over full well."""
    rng = np.random.default_rng(1000 + seed)
    seen = []
    for moved in (np.zeros(2), shift_px):
        exact = np.clip(2 * light * texture(size, seed, period_px, moved), 0, 1)
        seen.append(exact + rng.standard_normal(exact.shape) * np.sqrt(_variance(exact) / frames))
    variance = ndimage.uniform_filter(sum(_variance(image) for image in seen) / frames, 2 * WINDOW_PX)
    return seen[0].astype(np.float32), seen[1].astype(np.float32), variance.astype(np.float32)


def _variance(image: np.ndarray) -> np.ndarray:
    return (np.maximum(image, 0) * _FULL_WELL_E + _READ_E**2) / _FULL_WELL_E**2 + 1 / 12 / _STEPS**2


def airlens(reference: np.ndarray, flow: np.ndarray, variance: np.ndarray) -> Found:
    """This project's windows."""
    found = measure_shift(reference, flow, variance, WINDOW_PX)
    return found.displacement_px, standard_deviation_px(found)


def phase_correlation(reference: np.ndarray, flow: np.ndarray, variance: np.ndarray) -> Found:
    """scikit-image's phase correlation of each window, refined to a hundredth of a pixel."""
    px = WINDOW_PX
    shifts = [
        -phase_cross_correlation(
            reference[row : row + px, column : column + px],
            flow[row : row + px, column : column + px],
            upsample_factor=100,
            normalization=None,
        )[0][::-1]
        for row in range(0, reference.shape[0] - px + 1, px)
        for column in range(0, reference.shape[1] - px + 1, px)
    ]
    return np.array(shifts), None


def iterative_lucas_kanade(reference: np.ndarray, flow: np.ndarray, variance: np.ndarray) -> Found:
    """scikit-image's dense Lucas-Kanade flow, averaged over each window."""
    rows, columns = optical_flow_ilk(reference, flow, radius=WINDOW_PX // 2, num_warp=10)
    n = reference.shape[0] // WINDOW_PX

    def windows(field: np.ndarray) -> np.ndarray:
        return (
            field[: n * WINDOW_PX, : n * WINDOW_PX].reshape(n, WINDOW_PX, n, WINDOW_PX).mean((1, 3)).ravel()
        )

    return np.stack([windows(columns), windows(rows)], axis=1), None


ESTIMATORS = {"airlens": airlens, "phase_cross_correlation": phase_correlation, "ilk": iterative_lucas_kanade}
CASES = [
    *[(5.0, 100, 0.5, s) for s in (0.005, 0.02, 0.1, 0.3, 0.6, 1.0, 2.0, 5.0)],
    *[(5.0, 1, 0.05, s) for s in (0.02, 0.3, 2.0)],
    *[(5.0, 4, 0.02, s) for s in (0.05, 0.3)],
    *[(8.0, 100, 0.5, s) for s in (0.1, 2.0)],
]


def measured(size: int, seeds: int) -> Iterator[dict[str, object]]:
    """Every case by every estimator."""
    n = size // WINDOW_PX
    centre = (np.arange(n) + 0.5) * WINDOW_PX
    inner = np.array([EDGE_PX < min(x, y) and max(x, y) < size - EDGE_PX for y in centre for x in centre])
    for period_px, frames, light, length_px in CASES:
        shift_px = length_px * np.array([1.0, -0.6])
        pairs = [pair(size, seed, period_px, frames, light, shift_px) for seed in range(seeds)]
        for name, estimator in ESTIMATORS.items():
            began_s = time.process_time()
            found = [estimator(*images) for images in pairs]
            error = np.concatenate([shift[inner] - shift_px for shift, _ in found])
            line = {
                "period_px": period_px, "frames": frames, "light": light, "shift_px": length_px,
                "estimator": name, "bias": float((error @ shift_px).mean() / (shift_px @ shift_px)),
                "rms_px": float(np.sqrt((error**2).mean())),
                "outliers": float((np.abs(error).max(axis=1) > 0.5).mean()),
                "cpu_s": round((time.process_time() - began_s) / seeds, 3),
            }  # fmt: skip
            if found[0][1] is not None:
                z = error / np.concatenate([std[inner] for _, std in found if std is not None])
                line["rms_z"] = float(np.sqrt((z**2).mean()))
            yield {key: round(value, 5) if isinstance(value, float) else value for key, value in line.items()}


def photographed(folder: Path) -> Iterator[dict[str, object]]:
    """A photographed pair by this project and by scikit-image's dense flow, beside PIVlab's."""
    reference, flow = (
        tifffile.imread(folder / f"{name}.tif") / np.float32(255) for name in ("reference", "flow")
    )
    known = measure_shift(reference, flow, 2 / 12 / 255**2, _PIV_PX)
    at = known.centres_px[:, ::-1]
    piv = np.stack([_piv(folder / f"{way}_piv.mat", at) for way in "uv"], axis=1)
    rows, columns = optical_flow_ilk(reference, flow, radius=_PIV_PX // 2, num_warp=10)
    row, column = at.astype(int).T
    dense = np.stack([columns[row, column], rows[row, column]], axis=1)
    kept = np.isfinite(piv).all(axis=1) & (
        np.ones(len(at), bool) if known.refused is None else ~known.refused
    )
    length_px = np.linalg.norm(piv, axis=1)
    for name, found in (("airlens", known.displacement_px), ("ilk", dense)):
        for low_px, high_px in ((0.0, 0.3), (0.3, 1.0), (1.0, 8.0), (0.0, 8.0)):
            chosen = kept & (length_px >= low_px) & (length_px < high_px)
            pair_px, piv_px = found[chosen], piv[chosen]
            rms_px = np.sqrt(((pair_px - piv_px) ** 2).mean(axis=0))
            yield {
                "pair": folder.name, "moved_px": [low_px, high_px], "windows": int(chosen.sum()), "estimator": name,
                "rms_px": [round(float(px), 4) for px in rms_px],
                "slope": round(float((pair_px * piv_px).sum() / (piv_px**2).sum()), 3),
            }  # fmt: skip


def _piv(path: Path, at_px: np.ndarray) -> np.ndarray:
    """What PIVlab found at places (row, column); NaN beyond its grid, which begins a window from the edge."""
    (cell,) = (value for name, value in io.loadmat(path).items() if not name.startswith("__"))
    found = np.asarray(cell.ravel()[0], float)
    axes = [_PIV_PX + 0.5 + _PIV_PX / 2 * np.arange(n) for n in found.shape]
    return RegularGridInterpolator(axes, found, bounds_error=False, fill_value=np.nan)(at_px)


def main() -> None:
    """Print the lines."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--size", type=int, default=512)
    parser.add_argument("--photographed", type=Path)
    options = parser.parse_args()
    chosen = options.photographed
    for line in photographed(chosen) if chosen else measured(options.size, options.seeds):
        print(json.dumps(line), flush=True)


if __name__ == "__main__":
    main()
