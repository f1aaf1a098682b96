import numpy as np
import pytest

from app.volume.file import RoomVolume
from app.volume.scene import known_boundary
from core.scene import Outlet

VERTICES = (5, 21, 21)


def read_k(outlet: dict[str, list[float]]) -> float:
    """What the outlet's thermometer reads where air of 300 K leaves through a wall of 290 K.

    As programs for flow write it: a vertex on the outlet's rim has the mean of air and wall.
    """
    x, y, z = (np.linspace(0.0, 2.0, n) for n in VERTICES)
    temperature = np.full(VERTICES, 300.0, np.float32)
    inside, reached = (
        np.ix_(within(y, outlet["y"], margin_m), within(z, outlet["z"], margin_m))
        for margin_m in (-1e-6, 1e-6)
    )
    temperature[0] = 290.0
    temperature[0][reached] = 295.0
    temperature[0][inside] = 300.0
    volume = RoomVolume(
        x, y, z, temperature, np.zeros(VERTICES, np.float32), np.zeros((*VERTICES, 3), np.float32), 293.15,
        case={"outlet": outlet},
    )  # fmt: skip
    (found,) = (part for part in known_boundary(volume, "operator") if isinstance(part, Outlet))
    assert found.mean_temperature_k is not None
    return found.mean_temperature_k


def within(axis: np.ndarray, span: list[float], margin_m: float) -> np.ndarray:
    return (axis > span[0] - margin_m) & (axis < span[1] + margin_m)


def test_a_thermometer_in_an_outlet_reads_the_air_and_not_the_rim():
    assert read_k({"y": [0.5, 1.5], "z": [0.2, 0.6]}) == pytest.approx(300.0)


def test_a_slot_narrower_than_the_vertices_reads_what_is_there():
    # One row of vertices, on neither rim.
    assert read_k({"y": [0.5, 1.5], "z": [0.28, 0.32]}) == pytest.approx(300.0)
