"""The picture of a room beside its truth that the README shows, from a solved experiment.

    python -m tests.benchmarks.pictures EXPERIMENT [--truth ROOM.npz]     # results/room.png

The picture of the page is made by `python -m tests.browser.gallery --readme`.
"""

import argparse
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from app.experiment.folder import open_experiment
from app.experiment.results import read_result
from app.volume.file import RoomVolume, read_volume
from app.volume.score import values_at

RESULTS = Path(__file__).resolve().parent / "results"
CELSIUS_K = 273.15


def room_figure(experiment: Path, truth: RoomVolume) -> Figure:
    """The middle plane of a room: its truth, what the newest result found, and how sure that is."""
    found = read_result(open_experiment(experiment).latest_result() / "result.nc")
    if found.velocity_m_s is None or found.temperature_std_k is None:
        raise SystemExit(
            f"The newest result of {experiment} has no velocity; reconstruct with --preset standard."
        )
    warm_k = values_at(truth, found, found.temperature_k)
    velocity_m_s = values_at(truth, found, found.velocity_m_s)
    std_k = values_at(truth, found, found.temperature_std_k)
    figure = Figure(figsize=(9.5, 6.4), layout="constrained")
    axes = figure.subplots(2, 2)
    low, high = np.percentile(truth.temperature_k - CELSIUS_K, [3.0, 99.7])
    for axis, title, kelvin, arrows in (
        (axes[0, 0], "truth", truth.temperature_k, truth.velocity_m_s),
        (axes[0, 1], "found", warm_k, velocity_m_s),
    ):
        drawn = _slice(axis, truth, kelvin - CELSIUS_K, "inferno", float(low), float(high))
        _arrows(axis, truth, arrows)
        axis.set_title(title)
    figure.colorbar(drawn, ax=axes[0], label="T [°C]")
    limit = float(2 * np.percentile(std_k, 99))
    for axis, title, values, colours in (
        (axes[1, 0], "found minus truth", warm_k - truth.temperature_k, "RdBu_r"),
        (axes[1, 1], "stated: two standard deviations", 2 * std_k, "RdBu_r"),
    ):
        drawn = _slice(axis, truth, values, colours, -limit, limit)
        axis.set_title(title)
    figure.colorbar(drawn, ax=axes[1], label="T [K]")
    return figure


def _slice(axis: Axes, truth: RoomVolume, values: np.ndarray, colours: str, low: float, high: float):
    middle = values[:, values.shape[1] // 2].T
    axis.set_aspect("equal")
    axis.set_xlabel("x [m]")
    axis.set_ylabel("z [m]")
    return axis.pcolormesh(truth.x_m, truth.z_m, middle, cmap=colours, vmin=low, vmax=high, shading="gouraud")


def _arrows(axis: Axes, truth: RoomVolume, velocity_m_s: np.ndarray) -> None:
    across, up = (max(1, len(of) // 16) for of in (truth.x_m, truth.z_m))
    plane = velocity_m_s[::across, velocity_m_s.shape[1] // 2, ::up]
    axis.quiver(
        truth.x_m[::across], truth.z_m[::up], plane[..., 0].T, plane[..., 2].T,
        color="white", scale=4.0, width=0.005,
    )  # fmt: skip


def main() -> None:
    """Draw what was asked for."""
    parser = argparse.ArgumentParser()
    parser.add_argument("experiment", type=Path)
    parser.add_argument("--truth", type=Path, help="another one than the simulated experiment's own")
    options = parser.parse_args()
    truth = options.truth or open_experiment(options.experiment).truth
    if truth is None:
        parser.error("this experiment knows no truth: name it with --truth")
    room_figure(options.experiment, read_volume(truth)).savefig(RESULTS / "room.png", dpi=90)


if __name__ == "__main__":
    main()
