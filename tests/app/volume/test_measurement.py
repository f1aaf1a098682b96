"""The data of a benchmark come from another operator than the one that inverts them."""

from importlib.resources import files
from pathlib import Path

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest

from app.volume import measurement as synthetic_problem
from app.volume.file import read_volume
from app.volume.scene import RigOptions, room_scene
from core.rays import NonlinearTracer
from core.rays.operator import StraightRayOperator, build
from core.rays.visibility import sees_wall
from core.view_frame import facing, field_facing, turn_of

VOLUME = read_volume(Path(str(files("app.simulate.sample") / "room.npz")))
SCENE = room_scene(VOLUME, RigOptions(camera_px=(256, 192), walls=("y_max", "x_max")), "paper")


@pytest.mark.parametrize("view", [0, 1])
def test_simulated_shifts_are_not_the_inversion_s_own_operator(monkeypatch, view):
    """No inverse crime: bent rays through twice as many vertices, against matrices on the volume's own."""

    def refuse(*_):
        raise AssertionError("the simulation used the inversion's operator")

    centres = synthetic_problem._centres(SCENE, view, 8)
    operator = build(SCENE, view, centres, VOLUME.temperature_k.shape, 8.0)
    excess_k = jnp.asarray(VOLUME.temperature_k - VOLUME.ambient_k, jnp.float32)
    excess = SCENE.air.excess_refractivity(excess_k)
    inverted = np.asarray(eqx.filter_jit(lambda o, e: o.apply(e))(operator, excess))
    monkeypatch.setattr(StraightRayOperator, "apply", refuse)

    field = synthetic_problem.fine_field(VOLUME, SCENE)
    facing_it = field_facing(field, turn_of(SCENE, view))
    simulated = synthetic_problem._traced(*facing(SCENE, view), facing_it, centres, 8)

    assert [n - 1 for n in field.values.shape] == [2 * (n - 1) for n in VOLUME.temperature_k.shape]
    assert isinstance(synthetic_problem.tracer_of(SCENE), NonlinearTracer)
    # Away from the walls, whose thermal layers no grid holds.
    inner = sees_wall(SCENE, view, centres, margin_px=32.0)
    a, b = (v[inner] for v in (simulated, inverted))
    assert len(a) > 20
    difference = np.sqrt(np.mean((a - b) ** 2) / np.mean(b**2))
    # Measured 0.02 and 0.06: the same physics, but by no means the same numbers (float32 rounding is 1e-6).
    assert 1e-3 < difference < 0.2


@pytest.mark.parametrize("view", [0, 1])
def test_windows_know_their_noise_and_the_seed_draws_it(view):
    options = RigOptions(camera_px=(192, 144), frames=4, walls=("y_max", "x_max"))
    first, again, other = (
        synthetic_problem.synthetic_problem(VOLUME, options, "paper", window_px=16, seed=seed).shifts[view]
        for seed in (0, 0, 1)
    )
    np.testing.assert_array_equal(first.displacement_px, again.displacement_px)
    scatter = (first.displacement_px - other.displacement_px) / 2**0.5
    stated = np.sqrt(np.diagonal(np.linalg.inv(first.information_per_px2), axis1=1, axis2=2))
    textured = stated.max(1) < 1.0
    # Some 60 numbers: 10 % of scatter, four sigma.
    assert np.sqrt(np.mean((scatter / stated)[textured] ** 2)) == pytest.approx(1.0, abs=0.4)
