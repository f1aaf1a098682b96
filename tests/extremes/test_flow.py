"""Equations of the flow without dimensions: Re and Pe 1 to 1e7, Ri 0 to 1e4, still air, one cell."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from core.air import Air
from core.estimate.uncertainty import deviation
from core.grid import Staggered, StaggeredGrid, discrete_residuals
from core.losses.boussinesq import FlowValues, Numbers, Scales, residuals, scales
from core.metrics import score_pressure, score_temperature, score_velocity
from tests.extremes.row import Near, Refused, Row, Within, extremes, prove

STAGE = "flow"
AIR = Air()
RNG = np.random.default_rng(0)
# One point of a flow: values, slopes [component, axis], Laplacians.
U, P, T = RNG.normal(size=3), 0.3, 0.7
GRAD_U, GRAD_P, GRAD_T = RNG.normal(size=(3, 3)), RNG.normal(size=3), RNG.normal(size=3)
LAP_U, LAP_T = RNG.normal(size=3), -0.4


def point(reynolds: float, richardson: float, peclet: float) -> Row:
    """The residuals of a point in float32 against the equations written out in float64."""

    def run() -> np.ndarray:
        f32 = lambda v: jnp.asarray(v, jnp.float32)  # noqa: E731
        found = residuals(
            FlowValues(f32(T), f32(P), f32(U)), FlowValues(f32(GRAD_T), f32(GRAD_P), f32(GRAD_U)),
            FlowValues(f32(LAP_T), f32(0.0), f32(LAP_U)),
            Numbers(reynolds=reynolds, peclet=peclet, richardson=richardson),
        )  # fmt: skip
        return np.concatenate([np.ravel(found.mass), np.ravel(found.momentum), np.ravel(found.heat)])

    momentum = GRAD_U @ U + GRAD_P - LAP_U / reynolds + richardson * T * np.array([0.0, 0.0, -1.0])
    expected = np.array([np.trace(GRAD_U), *momentum, GRAD_T @ U - LAP_T / peclet])
    # The largest term sets the rounding.
    allowed = 1e-6 * max(1.0, richardson)
    return Row(STAGE, f"Re {reynolds:g}, Ri {richardson:g}, Pe {peclet:g}", run, Near(expected, abs=allowed))


def numbers(name: str, words: str, reynolds: float, peclet: float) -> Row:
    make = lambda: float(Numbers(reynolds=reynolds, peclet=peclet, richardson=0.0).reynolds)  # noqa: E731
    return Row(STAGE, name, make, Refused(words))


def scaled(length_m: float, speed_m_s: float, excess_k: float) -> Row:
    """A state to dimensionless and back in float32, whatever the scales."""
    name = f"scales of {length_m:g} m, {speed_m_s:g} m/s, {excess_k:g} K"

    def run() -> np.ndarray:
        found = scales(length_m=length_m, speed_m_s=speed_m_s, excess_k=excess_k, air=AIR)
        kelvin = jnp.asarray([293.15, 293.15 + excess_k], jnp.float32)
        speed = jnp.full((2, 3), speed_m_s, jnp.float32)
        back_k, _, back = found.to_si(found.to_nd(kelvin, jnp.zeros(2), speed))
        return np.concatenate([(back_k - kelvin) / 300.0, np.ravel(back - speed) / max(speed_m_s, 1.0)])

    return Row(STAGE, name, run, Near(0.0, abs=1e-6))


def finite_numbers(length_m: float, speed_m_s: float, excess_k: float) -> Row:
    def run() -> np.ndarray:
        found: Scales = scales(length_m=length_m, speed_m_s=speed_m_s, excess_k=excess_k, air=AIR)
        made = found.numbers(viscosity_m2_s=1.5e-5, diffusivity_m2_s=2.1e-5, air=AIR)
        return np.array([made.reynolds, made.peclet, abs(made.richardson)])

    # The speed's floor keeps Ri at a hundred of the buoyant speed's.
    name = f"numbers of {length_m:g} m, {speed_m_s:g} m/s, {excess_k:g} K"
    return Row(STAGE, name, run, Within(0.0, 1e9))


def grid_state(grid: StaggeredGrid, dtype: type) -> Staggered:
    """T = 2 x - z, p = 3 z, u = (x, -y, 0): residuals known exactly wherever the grid is."""

    def at(axes, function):
        mesh = np.meshgrid(*axes, indexing="ij")
        return jnp.asarray(function(*mesh), dtype)

    t, p, u, v, w = grid.axes
    return Staggered(
        at(t, lambda x, y, z: 2 * x - z),
        at(p, lambda x, y, z: 3 * z),
        (at(u, lambda x, y, z: x), at(v, lambda x, y, z: -y), at(w, lambda x, y, z: 0 * z)),
    )


@eqx.filter_jit
def compiled(state: Staggered, grid: StaggeredGrid, reynolds: jax.Array, richardson: float):
    given = Numbers(reynolds=reynolds, peclet=reynolds, richardson=richardson)
    return discrete_residuals(state, grid, given)


def cells(name: str, shape: tuple[int, int, int], reynolds: float, richardson: float, dtype: type) -> Row:
    """mass 0, momentum (x, y, 3 - Ri (2 x - z)), heat 2 x: on any grid, for any Re."""
    grid = StaggeredGrid((0.0, 0.0, 0.0), (1.0, 1.0, 1.0), shape)

    def run() -> np.ndarray:
        with jax.enable_x64(dtype is np.float64):
            state = grid_state(grid, dtype)
            mass, momentum, heat = compiled(state, grid, jnp.asarray(reynolds, dtype), richardson)
            (tx, ty, tz), (_, _, wz) = grid.axes[1], grid.axes[4]
            x, _, z = np.meshgrid(tx, ty, wz[1:-1], indexing="ij")
            xc = np.meshgrid(tx, ty, tz, indexing="ij")[0]
            left = [mass, heat - 2 * xc, momentum[2] - (3 - richardson * (2 * x - z))]
            scale = max(1.0, richardson)
            return np.concatenate([np.ravel(v) / scale for v in left])

    # A difference of numbers of size 1 over a cell, in float32.
    return Row(STAGE, name, run, Near(0.0, abs=1e-11 if dtype is np.float64 else 2e-5 * max(shape)))


CUBE = np.ones((4, 5, 3))
VECTORS = np.ones((4, 5, 3, 3))


def scored(name: str, run, expected) -> Row:
    return Row(STAGE, f"score of {name}", run, expected)


def uncertain(
    name: str, derivative: float, covariance: float, difference: float, std: float, informed: float
) -> Row:
    """One parameter, and a model that is wrong alike everywhere: std^2 = D^2 C + s^2,
    informed = 1 - (D^2 C + s^2) / (D^2 + s^2).
    """

    def run() -> np.ndarray:
        slope = np.full((1, 3, 3, 3), derivative)
        found = deviation(slope, np.array([[covariance]]), np.full((3, 3, 3), difference))
        return np.stack([found.std, found.informed], axis=-1)

    expected = Near(np.broadcast_to([std, informed], (3, 3, 3, 2)), rel=1e-6, abs=1e-9)
    return Row(STAGE, f"deviation with {name}", run, expected)


GRIDS = [((1, 1, 2), "two cells"), ((2, 2, 2), "8 cells"), ((16, 1, 3), "a slab of one cell")]

ROWS = [
    *[point(re, ri, pe) for re in (1.0, 1e3, 1e7) for ri in (0.0, 1.0, 1e4) for pe in (1.0, 1e3, 1e7)],
    numbers("Re 0", "finite positive", 0.0, 1.0),
    numbers("Re below 0", "finite positive", -5.0, 1.0),
    numbers("Re without end", "finite positive", float("inf"), 1.0),
    numbers("Pe NaN", "finite positive", 1.0, float("nan")),
    numbers("Pe 0", "finite positive", 1.0, 0.0),
    *[scaled(*s) for s in (
        (3.0, 0.5, 10.0), (3.0, 0.0, 0.0), (3.0, 0.0, 10.0), (3.0, 0.5, 0.001), (0.01, 0.1, 500.0),
        (100.0, 10.0, 2000.0), (3.0, 0.5, -10.0),
    )],
    *[finite_numbers(*s) for s in (
        (3.0, 0.0, 0.0), (0.01, 0.0, 0.001), (0.01, 0.0, 2000.0), (100.0, 0.0, 2000.0), (100.0, 100.0, 0.0),
    )],
    *[cells(f"{name}, Re {re:g}, Ri {ri:g}, {np.dtype(d).name}", shape, re, ri, d)
      for shape, name in GRIDS for re, ri in ((1.0, 1e4), (1e7, 1e4)) for d in (np.float32, np.float64)],
    scored("T = T0 everywhere, found exactly",
           lambda: score_temperature(300 * CUBE, 300 * CUBE, 300.0)["rms_K"], Near(0.0)),
    scored("2000 K", lambda: score_temperature(300 * CUBE, 2300 * CUBE, 300.0)["rms_K"], Near(2000.0)),
    scored("a truth without departures",
           lambda: float(score_temperature(300 * CUBE, 300 * CUBE, 300.0)["rel_departure"] is None),
           Near(1.0)),
    scored("still air", lambda: float(score_velocity(0 * VECTORS, 0 * VECTORS, 0.5)["rel"] is None), Near(1.0)),
    scored("no flow found", lambda: score_velocity(0 * VECTORS, VECTORS, 0.5)["rel"], Near(1.0)),
    scored("a pressure of nothing", lambda: float(score_pressure(CUBE, 0 * CUBE)["rel"] is None), Near(1.0)),
    uncertain("nothing measured", 1.0, 1.0, 0.05, 1.0025**0.5, 0.0),
    uncertain("no parameter that matters", 0.0, 1.0, 0.05, 0.05, 0.0),
    uncertain("1e-12 of variance left", 1.0, 1e-12, 0.05, 0.05, 1.0 / 1.0025),
    uncertain("models 1e3 apart", 1.0, 1.0, 1e3, (1.0 + 1e6) ** 0.5, 0.0),
]  # fmt: skip


@extremes(ROWS)
def test_flow_at_its_limits(row: Row, record_property):
    prove(row, record_property)
