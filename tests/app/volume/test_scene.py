from dataclasses import replace

import numpy as np
import pytest

from app.errors import BadInputError
from app.volume.file import RoomVolume
from app.volume.scene import known_boundary
from core.scene import Inlet, Outlet, Patch

VERTICES = (5, 21, 21)
CELL_M = 0.12


def volume_of(outlet: dict[str, list[float]]) -> RoomVolume:
    """Air of 300 K before a wall of 290 K that has an outlet.

    As programs for flow write it: a vertex within a cell of the outlet's rim has a part of the wall's temperature.
    """
    x, y, z = axes = [np.linspace(0.0, 2.0, n) for n in VERTICES]
    temperature = np.full(VERTICES, 300.0, np.float32)
    inside, reached = (
        np.ix_(*(within(axis, span, margin_m) for axis, span in zip(axes[1:], outlet.values(), strict=True)))
        for margin_m in (-CELL_M, 1e-6)
    )
    temperature[0] = 290.0
    temperature[0][reached] = 295.0
    temperature[0][inside] = 300.0
    velocity = np.zeros((*VERTICES, 3), np.float32)
    velocity[0, ..., 0][reached] = -0.1
    velocity[0, ..., 0][inside] = -0.2
    return RoomVolume(
        x, y, z, temperature, np.zeros(VERTICES, np.float32), velocity, 293.15, case={"outlet": outlet}
    )


def still() -> RoomVolume:
    """Still air of one temperature, on five vertices along x."""
    x, y, z = (np.linspace(0.0, 2.0, n) for n in VERTICES)
    zero = np.zeros(VERTICES, np.float32)
    return RoomVolume(x, y, z, zero + np.float32(293.0), zero, np.zeros((*VERTICES, 3), np.float32), 293.15)


def within(axis: np.ndarray, span: list[float], margin_m: float) -> np.ndarray:
    return (axis > span[0] - margin_m) & (axis < span[1] + margin_m)


def read_k(volume: RoomVolume) -> float:
    """What the outlet's thermometer reads."""
    (found,) = (part for part in known_boundary(volume, "operator") if isinstance(part, Outlet))
    assert found.mean_temperature_k is not None
    return found.mean_temperature_k


@pytest.mark.parametrize("z", [[0.2, 0.6], [0.2, 0.63], [0.17, 0.69]])
def test_a_thermometer_in_an_outlet_reads_the_air_and_not_the_rim(z):
    assert read_k(volume_of({"y": [0.5, 1.5], "z": z})) == pytest.approx(300.0)


def test_a_slot_narrower_than_the_vertices_reads_what_is_there():
    # One row of vertices, on neither rim.
    assert read_k(volume_of({"y": [0.5, 1.5], "z": [0.28, 0.32]})) == pytest.approx(300.0)


def test_what_leaves_counts_by_how_fast_it_leaves():
    volume = volume_of({"y": [0.45, 1.55], "z": [0.25, 0.85]})
    upper = volume.z_m > 0.55
    volume.temperature_k[1][:, upper] = 296.0
    volume.velocity_m_s[0][:, upper] *= 3.0
    assert read_k(volume) == pytest.approx((1 * 300.0 + 3 * 296.0) / 4)
    volume.velocity_m_s[:] = 0.0
    assert read_k(volume) == pytest.approx(298.0)


def test_an_outlet_between_the_vertices_is_refused():
    with pytest.raises(BadInputError, match="finer grid"):
        read_k(volume_of({"y": [0.5, 1.5], "z": [0.22, 0.28]}))


@pytest.mark.parametrize(
    ("box", "wall", "velocity_m_s"),
    [
        ({"y": [0.5, 1.0], "z": [0.2, 0.6]}, "x_min", (0.3, 0.0, 0.0)),
        ({"wall": "xMaxWall", "y": [0.5, 1.0], "z": [0.2, 0.6]}, "x_max", (-0.3, 0.0, 0.0)),
        ({"wall": "front", "x": [0.5, 1.0], "z": [0.2, 0.6]}, "y_min", (0.0, 0.3, 0.0)),
        ({"wall": "ceiling", "x": [0.5, 1.0], "y": [0.2, 0.6]}, "z_max", (0.0, 0.0, -0.3)),
    ],
)
def test_a_supply_blows_into_the_room_from_its_own_wall(box, wall, velocity_m_s):
    volume = replace(still(), case={"inlets": [{**box, "U": 0.3, "dT": 2.0}]})

    (inlet,) = (part for part in known_boundary(volume, "operator") if isinstance(part, Inlet))

    assert inlet.patch == Patch(wall=wall, lower_m=(0.5, 0.2), upper_m=(1.0, 0.6))
    assert inlet.velocity_m_s == velocity_m_s


def test_each_of_several_outlets_reads_what_leaves_by_it():
    high = {"wall": "ceiling", "x": [0.4, 1.6], "y": [0.4, 1.6]}
    low = {"wall": "xMaxWall", "y": [0.4, 1.6], "z": [0.2, 0.8]}
    volume = replace(still(), case={"outlets": [high, low]})
    volume.temperature_k[..., -2], volume.temperature_k[-2, :, :-2] = 300.0, 290.0
    # Air leaves by the ceiling's half nearer to x_min, which is warmer, and enters by the other.
    volume.temperature_k[:2, :, -2] = 302.0
    volume.velocity_m_s[..., -1, 2] = -0.1
    volume.velocity_m_s[:2, :, -1, 2] = 0.2

    found = [part for part in known_boundary(volume, "operator") if isinstance(part, Outlet)]

    assert [part.patch.wall for part in found] == ["z_max", "x_max"]
    assert [part.mean_temperature_k for part in found] == [pytest.approx(302.0), pytest.approx(290.0)]


@pytest.mark.parametrize(
    ("box", "said"),
    [
        ({"wall": "roof", "x": [0.4, 1.6], "y": [0.4, 1.6]}, "'roof'; expected one of xMinWall"),
        ({"wall": "ceiling", "y": [0.4, 1.6], "z": [0.4, 1.6]}, "no span along x and y"),
    ],
)
def test_an_opening_that_is_on_no_wall_is_refused(box, said):
    with pytest.raises(BadInputError, match=said):
        known_boundary(replace(still(), case={"outlet": box}), "operator")
