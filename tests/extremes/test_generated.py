"""Scenes that nobody thought of: whatever the numbers, an object that works or a refusal that says why."""

from functools import cache

import jax
import jax.numpy as jnp
import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from core.air import Air
from core.displacement import measure_shift
from core.fields import GridField
from core.geometry import Box, looking_along_y
from core.losses.boussinesq import scales
from core.rays import NonlinearTracer, Rays
from core.rays.bundle import clip_ray, corners_of
from core.scene import FixedTexture, Inlet, Patch, Scene, View
from core.setting import SettingError

NUMBER = st.floats(width=64)
PLACE = st.floats(-2000, 2000)
VECTOR = st.tuples(PLACE, PLACE, PLACE)
# The same examples in every run: a failure here is never a matter of luck.
often = settings(max_examples=80, deadline=None, derandomize=True, database=None)


def refused(make) -> bool:
    """Whether it is refused, with a sentence that says what to do."""
    said = ""
    try:
        make()
    except SettingError as refusal:
        said = str(refusal)
    assert not said or len(said.split(". ")) >= 2, said
    return bool(said)


@often
@given(NUMBER, NUMBER, NUMBER, NUMBER)
def test_any_air_is_finite_or_refused(pressure_pa, ambient_temperature_k, wavelength_m, gladstone_dale):
    def make() -> None:
        air = Air(
            pressure_pa=pressure_pa, ambient_temperature_k=ambient_temperature_k, wavelength_m=wavelength_m,
            gladstone_dale=gladstone_dale,
        )  # fmt: skip
        assert 0 < air.ambient_refractivity < 1

    refused(make)


@often
@given(st.floats(150, 2500), st.floats(1e4, 1e6), st.floats(200e-9, 2e-6), st.floats(-100, 2000))
def test_air_that_can_be_is_never_refused(kelvin, pascal, wavelength_m, excess_k):
    air = Air(ambient_temperature_k=kelvin, pressure_pa=pascal, wavelength_m=wavelength_m)

    found = float(air.excess_refractivity(jnp.float32(excess_k)))

    assert np.sign(found) in (0, -np.sign(np.float32(excess_k)))
    assert abs(found) <= 3 * air.ambient_refractivity


@often
@given(VECTOR, VECTOR, VECTOR, st.integers(-10, 10_000), NUMBER)
def test_any_scene_is_built_or_refused(lower_m, upper_m, position_m, width_px, focal_px):
    def make() -> None:
        room = Box(lower_m=lower_m, upper_m=upper_m)
        camera = looking_along_y(position_m=position_m, width_px=width_px, height_px=48, focal_px=focal_px)
        scene = Scene(room=room, views=(View(camera=camera),), light=FixedTexture())
        assert all(size > 0 for size in scene.room.size_m)

    refused(make)


@often
@given(NUMBER, VECTOR, st.tuples(NUMBER, NUMBER), st.tuples(NUMBER, NUMBER))
def test_any_inlet_is_made_or_refused(temperature_k, velocity_m_s, lower_m, upper_m):
    refused(
        lambda: Inlet(
            patch=Patch(wall="x_min", lower_m=lower_m, upper_m=upper_m), temperature_k=temperature_k,
            velocity_m_s=velocity_m_s,
        )
    )  # fmt: skip


@cache
def bent_by_noise():
    """One compiled program for every camera: eight rays to the wall, through noise of 0.1 of the air."""
    room = Box(lower_m=(0.0, 0.0, 0.0), upper_m=(4.0, 3.0, 3.0))
    values = 3e-5 * np.random.default_rng(0).normal(size=(4, 5, 3))
    field = GridField(room.lower_m, room.upper_m, values.astype(np.float32))

    @jax.jit
    def run(origin_m, points_m):
        towards = points_m - origin_m[None]
        direction = towards / jnp.maximum(jnp.linalg.norm(towards, axis=1, keepdims=True), 1e-30)
        entry, length, outcome = jax.vmap(lambda d: clip_ray(corners_of(room), origin_m, d))(direction)
        bend = NonlinearTracer(16, 2.7e-4).bend(Rays(entry, direction, length, outcome), field)
        return entry, length, bend.wall_shift_m, bend.outcome

    return run


@often
@given(VECTOR, st.lists(st.tuples(st.floats(0, 4), st.floats(0, 3)), min_size=8, max_size=8))
def test_rays_from_anywhere_end_in_a_named_outcome(origin_m, places):
    points_m = np.array([(x, 3.0, z) for x, z in places], np.float32)

    entry, length, shift, outcome = bent_by_noise()(jnp.asarray(origin_m, jnp.float32), jnp.asarray(points_m))

    assert all(np.isfinite(v).all() for v in (entry, length, shift))
    assert set(np.asarray(outcome).tolist()) <= {0, 1, 2, 3}
    # No ray is longer than the room's diagonal.
    assert float(length.max()) <= 6.0
    assert float(length.min()) >= 0.0


@often
@given(st.integers(0, 2**32 - 1), st.sampled_from([0.0, 1e-30, 1e-6, 1.0, 1e6]), st.sampled_from([8, 17, 64]))
def test_any_pair_of_images_has_finite_shifts(seed, contrast, size):
    rng = np.random.default_rng(seed)
    pair = [(0.5 + contrast * rng.normal(size=(size, size))).astype(np.float32) for _ in range(2)]

    found = measure_shift(pair[0], pair[1], 1e-6, 8)

    assert np.isfinite(found.displacement_px).all()
    assert np.linalg.eigvalsh(found.information_per_px2).min() > 0


@often
@given(st.floats(1e-3, 500), st.floats(-100, 100), st.floats(-2000, 2000))
def test_any_flow_has_finite_numbers(length_m, speed_m_s, excess_k):
    found = scales(length_m=length_m, speed_m_s=speed_m_s, excess_k=excess_k, air=Air())
    numbers = found.numbers(viscosity_m2_s=1.5e-5, diffusivity_m2_s=2.1e-5, air=Air())

    assert found.velocity_m_s > 0
    assert found.excess_k != 0
    # The floor of the speed: a tenth of the buoyant one.
    assert abs(numbers.richardson) <= 100.1
