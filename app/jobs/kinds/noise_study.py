"""Kind `noise-study`: how well a window's shift can be told from noisy frames, by Monte Carlo.

Each trial draws shot and read noise for a reference and a shifted frame of one random texture and
measures the shift of every window as a reconstruction does (`core.displacement.measure_shift`). The
summary sets the scatter that was found beside the one that the measurement states of itself.
Trial k draws from the seed (seed, k) alone, so a run that was interrupted gives the same bits.
"""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Self

import numpy as np
from pydantic import Field, model_validator

from app.files.durable import durable_path
from app.files.toml import Strict, parse
from app.jobs.attempt import Attempt, CheckpointClock

EXPERIMENT = False


class NoiseStudy(Strict):
    """`electrons` is the signal at full scale; a frame is the mean of `frames` exposures."""

    electrons: float = Field(default=10000.0, gt=0, le=1e9)
    read_noise_electrons: float = Field(default=3.0, ge=0, le=1e6)
    frames: int = Field(default=1, ge=1, le=1_000_000)
    shift_px: float = Field(default=0.05, ge=-1, le=1)
    window_px: int = Field(default=16, ge=4, le=2048)
    size_px: int = Field(default=128, ge=32, le=2048)
    trials: int = Field(default=200, ge=1, le=10_000_000)
    seed: int = Field(default=0, ge=0, le=(1 << 53) - 1)

    @model_validator(mode="after")
    def _whole_windows(self) -> Self:
        if self.size_px % self.window_px:
            raise ValueError(f"size_px is {self.size_px}: make it a multiple of window_px ({self.window_px})")
        return self


def read(settings: Mapping[str, Any]) -> NoiseStudy:
    """Return the settings. Raises BadInputError."""
    return parse(dict(settings), NoiseStudy, source="the settings of a noise study")


@dataclass(frozen=True)
class _Sums:
    """What the trials so far add up to, for each window: the shift, its square, its stated variance."""

    trials: int
    shift_px: np.ndarray
    square_px2: np.ndarray
    stated_px2: np.ndarray

    def scatter_px(self) -> float:
        """Standard deviation of a window's shift, over all windows and both directions."""
        return float(np.sqrt(np.mean(self.square_px2 / self.trials - (self.shift_px / self.trials) ** 2)))


def run(attempt: Attempt, study: NoiseStudy) -> dict[str, Any]:
    """Run the trials; return the scatter and the bias in pixels, with the scatter that is stated."""
    reference, shifted = _frames(study)
    sums = _resume(attempt.checkpoints, study)
    clock = CheckpointClock()
    while sums.trials < study.trials:
        sums = _add_trial(sums, reference, shifted, study)
        if attempt.stop.is_set() or clock.is_due():
            with clock.measure():
                _save(attempt.checkpoints, sums)
            attempt.progress(sums.trials, study.trials, {"scatter_px": sums.scatter_px()})
            attempt.check_stop()
    attempt.progress(sums.trials, study.trials, {"scatter_px": sums.scatter_px()})
    mean_px = sums.shift_px / study.trials
    np.save(attempt.output / "mean_px.npy", mean_px)
    np.save(attempt.output / "variance_px2.npy", sums.square_px2 / study.trials - mean_px**2)
    return {
        "settings": study.model_dump(),
        "scatter_px": sums.scatter_px(),
        "stated_scatter_px": float(np.sqrt(np.mean(sums.stated_px2 / study.trials))),
        "bias_px": float(np.mean(mean_px[:, 0]) - study.shift_px),
    }


def _frames(study: NoiseStudy) -> tuple[np.ndarray, np.ndarray]:
    """Return a band-limited texture in 0.1..0.9 and the same shifted along the columns, exactly."""
    random = np.random.default_rng([study.seed, study.size_px])
    frequency = np.fft.fftfreq(study.size_px)
    radius2 = frequency[:, None] ** 2 + frequency[None, :] ** 2
    spectrum = np.fft.fft2(random.normal(size=(study.size_px, study.size_px))) * np.exp(-radius2 / 0.02)
    shifted = np.fft.ifft2(spectrum * np.exp(-2j * np.pi * frequency[None, :] * study.shift_px)).real
    texture = np.fft.ifft2(spectrum).real
    low, high = texture.min(), texture.max()
    return 0.1 + 0.8 * (texture - low) / (high - low), 0.1 + 0.8 * (shifted - low) / (high - low)


def _add_trial(sums: _Sums, reference: np.ndarray, shifted: np.ndarray, study: NoiseStudy) -> _Sums:
    # Imported here: reading a job's settings must not cost the start of the array library.
    from core.displacement import measure_shift, standard_deviation_px

    random = np.random.default_rng([study.seed, sums.trials])
    seen, moved = _expose(reference, study, random), _expose(shifted, study, random)
    electrons = study.electrons * study.frames
    variance = 2 * (reference / electrons + study.read_noise_electrons**2 / (study.electrons * electrons))
    measured = measure_shift(seen, moved, variance, study.window_px)
    shift_px = np.asarray(measured.displacement_px)
    return _Sums(
        trials=sums.trials + 1,
        shift_px=sums.shift_px + shift_px,
        square_px2=sums.square_px2 + shift_px**2,
        stated_px2=sums.stated_px2 + standard_deviation_px(measured) ** 2,
    )


def _expose(luminance: np.ndarray, study: NoiseStudy, random: np.random.Generator) -> np.ndarray:
    """Return the mean of the exposures, in full scales."""
    electrons = random.poisson(luminance * study.electrons * study.frames) / study.frames
    noise = random.normal(scale=study.read_noise_electrons / study.frames**0.5, size=luminance.shape)
    return (electrons + noise) / study.electrons


def _save(folder: Path, sums: _Sums) -> None:
    with durable_path(folder / "sums.npz") as temporary:
        np.savez(temporary, **asdict(sums))


def _resume(folder: Path, study: NoiseStudy) -> _Sums:
    if not (folder / "sums.npz").exists():
        zero = np.zeros(((study.size_px // study.window_px) ** 2, 2))
        return _Sums(trials=0, shift_px=zero, square_px2=zero, stated_px2=zero)
    with np.load(folder / "sums.npz", allow_pickle=False) as saved:
        arrays = {name: saved[name] for name in ("shift_px", "square_px2", "stated_px2")}
        return _Sums(trials=int(saved["trials"]), **arrays)
