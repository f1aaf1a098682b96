import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from core.air import Air
from core.losses.boussinesq import FlowValues, Numbers, residuals, scales
from core.setting import SettingError

NUMBERS = Numbers(reynolds=40.0, peclet=30.0, richardson=2.5)


def slot(x):
    """Conduction between a hot and a cold wall drives a cubic velocity profile (Batchelor 1954)."""
    drive = NUMBERS.reynolds * NUMBERS.richardson
    return FlowValues(x[0], 0.0 * x[0], jnp.array([0.0, 0.0, drive * (x[0] - x[0] ** 3) / 6]))


def stratified_rolls(x):
    """Heat carried up an unstable stratification s balances diffusion: k^4 = -Re Ri Pe s."""
    k = 2.0
    s = -(k**4) / (NUMBERS.reynolds * NUMBERS.richardson * NUMBERS.peclet)
    swing = k**2 / (NUMBERS.reynolds * NUMBERS.richardson) * jnp.sin(k * x[0])
    pressure = NUMBERS.richardson * s * x[2] ** 2 / 2
    return FlowValues(s * x[2] + swing, pressure, jnp.array([0.0, 0.0, jnp.sin(k * x[0])]))


def kovasznay(x):
    """Kovasznay's (1948) nonlinear wake in horizontal planes under a hydrostatic stratification."""
    r = NUMBERS.reynolds
    decay = r / 2 - math.sqrt(r**2 / 4 + 4 * math.pi**2)
    envelope, phase = jnp.exp(decay * x[0]), 2 * math.pi * x[1]
    velocity = jnp.array(
        [1 - envelope * jnp.cos(phase), decay / (2 * math.pi) * envelope * jnp.sin(phase), 0.0]
    )
    pressure = (1 - envelope**2) / 2 + NUMBERS.richardson * x[2] ** 2 / 2
    return FlowValues(x[2], pressure, velocity)


def derivatives(flow, x):
    laplacian = jax.tree.map(lambda h: jnp.trace(h, axis1=-2, axis2=-1), jax.jacfwd(jax.jacfwd(flow))(x))
    return flow(x), jax.jacfwd(flow)(x), laplacian


@pytest.mark.parametrize("flow", [slot, stratified_rolls, kovasznay])
def test_residuals_vanish_for_exact_flows_in_float64(flow):
    with jax.enable_x64(True):
        points = jnp.array(np.random.default_rng(3).uniform(0, 1, (50, 3)))
        left = jax.jit(jax.vmap(lambda x: residuals(*derivatives(flow, x), NUMBERS)))(points)
    # Terms are of order 1 to 100: 1e-8 is rounding of float64 with room to spare.
    for name in ("mass", "momentum", "heat"):
        assert np.abs(np.asarray(getattr(left, name))).max() < 1e-8, name


def test_a_wrong_peclet_number_leaves_heat():
    wrong = Numbers(reynolds=40.0, peclet=60.0, richardson=2.5)
    left = residuals(*derivatives(stratified_rolls, jnp.array([0.3, 0.2, 0.1])), wrong)
    assert abs(float(left.heat)) > 1e-3


def test_gravity_points_down_hot_air_is_driven_up():
    zero = FlowValues(jnp.array(0.0), jnp.array(0.0), jnp.zeros(3))
    flat = FlowValues(jnp.zeros(3), jnp.zeros(3), jnp.zeros((3, 3)))
    hot = FlowValues(jnp.array(1.0), jnp.array(0.0), jnp.zeros(3))
    # The residual is minus the acceleration of a parcel at rest.
    assert float(residuals(hot, flat, zero, NUMBERS).momentum[2]) == pytest.approx(-2.5)


def test_scales_of_an_isothermal_inlet_and_of_still_air_have_floors():
    still = scales(length_m=3.0, speed_m_s=0.0, excess_k=0.0, air=Air())
    assert still.excess_k == pytest.approx(0.1)
    assert still.velocity_m_s == pytest.approx(0.0100, rel=0.01)
    heated = scales(length_m=3.0, speed_m_s=0.0, excess_k=10.0, air=Air())
    assert heated.velocity_m_s == pytest.approx(0.1 * math.sqrt(9.81 * 10 / 293.15 * 3.0))


def test_a_cold_inlet_keeps_the_sign_of_its_buoyancy():
    cold = scales(length_m=3.0, speed_m_s=0.5, excess_k=-8.0, air=Air())
    numbers = cold.numbers(viscosity_m2_s=1e-3, diffusivity_m2_s=1e-3, air=Air())
    flow = cold.to_nd(jnp.array([285.15]), jnp.zeros(1), jnp.zeros((1, 3)))
    assert float(flow.temperature[0]) == pytest.approx(1.0)
    assert numbers.richardson == pytest.approx(-9.81 * 8.0 / 293.15 * 3.0 / 0.25)


def test_case_a_numbers_follow_from_its_scales():
    found = scales(length_m=3.0, speed_m_s=0.5, excess_k=10.0, air=Air()).numbers(
        viscosity_m2_s=8.3812e-4, diffusivity_m2_s=9.895e-4, air=Air()
    )
    assert found.reynolds == pytest.approx(1790, rel=1e-3)
    assert found.richardson == pytest.approx(4.02, rel=2e-3)


def test_zero_viscosity_is_refused():
    with pytest.raises(SettingError, match="viscosity"):
        Numbers(reynolds=math.inf, peclet=1.0, richardson=1.0)


def test_si_inverts_nd():
    found = scales(length_m=3.0, speed_m_s=0.5, excess_k=10.0, air=Air())
    t_k, p, u = found.to_si(found.to_nd(jnp.array([300.0]), jnp.array([0.3]), jnp.array([[0.1, 0.2, 0.3]])))
    assert float(t_k[0]) == pytest.approx(300.0)
    assert float(p[0]) == pytest.approx(0.3)
    np.testing.assert_allclose(np.asarray(u), [[0.1, 0.2, 0.3]], rtol=1e-6)
