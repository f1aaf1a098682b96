import dataclasses

import jax
import numpy as np
import pytest

from core.geometry import Box, looking_along_y
from core.mlp import MlpSettings, initial_mlp
from core.problem import Problem
from core.result import Outcome, Solution
from core.scene import FixedTexture, Inlet, Outlet, Patch, Scene, View
from core.setting import SettingError
from core.solve.network.mlp_start import network_like
from core.solve.nondimensional import frame_of

ROOM = Box(lower_m=(0.0, -1.0, 0.0), upper_m=(3.0, 1.0, 2.0))


def scene() -> Scene:
    camera = looking_along_y(position_m=(1.5, -8.0, 1.0), width_px=64, height_px=48, focal_px=150.0)
    return Scene(
        room=ROOM,
        views=(View(camera=camera),),
        light=FixedTexture(),
        boundary=(
            Inlet(
                patch=Patch(wall="x_min", lower_m=(-0.3, 1.1), upper_m=(0.3, 1.5)),
                temperature_k=303.15,
                velocity_m_s=(0.4, 0.0, 0.0),
            ),
            Outlet(patch=Patch(wall="x_min", lower_m=(-0.3, 0.1), upper_m=(0.3, 0.5))),
        ),
    )


def smooth() -> Solution:
    x, y, z = (np.linspace(low, up, 9) for low, up in zip(ROOM.lower_m, ROOM.upper_m, strict=True))
    gx, gy, gz = np.meshgrid(x, y, z, indexing="ij")
    velocity = np.stack([0.2 * np.sin(gz), 0.1 * gx * gy, 0.1 * np.cos(gx)], axis=-1)
    return Solution(
        x,
        y,
        z,
        293.15 + 4.0 * gz + np.sin(gx),
        0.05 * gz**2,
        velocity,
        outcome=Outcome.converged,
        solver_s=0.0,
    )


def test_a_network_begins_as_the_solution_it_is_given():
    wanted = smooth()
    frame = frame_of(Problem(scene(), ()))
    bare = initial_mlp(MlpSettings(hidden_layers=2, width=32), frame.lower, frame.upper, jax.random.key(0))

    network = network_like(bare, wanted, frame, steps=1000, seed=1)

    temperature, pressure, velocity = frame.scales.to_si(network.on_grid(frame.vertices((9, 9, 9))))
    for found, true in (
        (temperature, wanted.temperature_k),
        (pressure, wanted.pressure_m2_s2),
        (velocity, wanted.velocity_m_s),
    ):
        assert true is not None
        # A small network after 1000 steps: a tenth of each field's own spread.
        assert np.std(np.asarray(found) - true) < 0.1 * np.std(true)


def test_a_solution_without_velocity_is_no_start():
    frame = frame_of(Problem(scene(), ()))
    bare = initial_mlp(MlpSettings(hidden_layers=1, width=4), frame.lower, frame.upper, jax.random.key(0))

    with pytest.raises(SettingError, match="has no velocity"):
        network_like(bare, dataclasses.replace(smooth(), velocity_m_s=None), frame, steps=1, seed=0)
