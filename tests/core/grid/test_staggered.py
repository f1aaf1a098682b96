import jax
import jax.numpy as jnp
import numpy as np
import pytest

from core.grid import Staggered, StaggeredGrid, discrete_residuals
from core.grid.interpolation import interpolation_matrix
from core.grid.multiresolution import MultiGrid, prolong, zero_multigrid
from core.losses.boussinesq import FlowValues, Numbers, residuals

NUMBERS = Numbers(reynolds=40.0, peclet=30.0, richardson=2.5)
LOWER, UPPER = (0.0, 0.0, 0.0), (1.4, 1.0, 1.0)


def exact(x, y, z):
    """Smooth (T, p, u, v, w) of no particular flow."""
    wave = jnp.sin(x + 2 * y) * jnp.cos(1.5 * z)
    return (
        jnp.cos(x * z) + y,
        x * y - z**2,
        wave,
        jnp.cos(x) * y + z,
        jnp.sin(y) * z + x * x,
    )


def sampled(grid):
    values = []
    fields = jax.jit(exact)
    for component, axes in enumerate(grid.axes):
        x, y, z = np.meshgrid(*axes, indexing="ij")
        values.append(jnp.asarray(fields(x, y, z)[component]))
    return Staggered.of(values)


def continuous(points):
    """Mass, momentum, heat of `exact` at points, by differentiation."""

    def one(point):
        t, p, u, v, w = exact(*point)
        return FlowValues(t, p, jnp.stack([u, v, w]))

    def at(point):
        hessian = jax.jacfwd(jax.jacfwd(one))(point)
        laplacian = jax.tree.map(lambda h: jnp.trace(h, axis1=-2, axis2=-1), hessian)
        value, slope = one(point), jax.jacfwd(one)(point)
        left = residuals(value, slope, laplacian, NUMBERS)
        # The grid's residuals are conservative: div(u f) = u . grad f + f div u.
        return (
            left.mass,
            left.momentum + value.velocity * left.mass,
            left.heat + value.temperature * left.mass,
        )

    return jax.jit(jax.vmap(at))(points)


def errors(n):
    grid = StaggeredGrid(LOWER, UPPER, (n, n, n))
    mass, momentum, heat = jax.jit(lambda s: discrete_residuals(s, grid, NUMBERS))(sampled(grid))
    centres, faces = ([grid._along(a, kind) for a in range(3)] for kind in ("centres", "faces"))
    found = []

    def compare(discrete, axes, part, component=None):
        mesh = np.stack([m.ravel() for m in np.meshgrid(*axes, indexing="ij")], -1)
        wanted = continuous(jnp.asarray(mesh))[part]
        wanted = wanted if component is None else wanted[:, component]
        found.append(float(np.sqrt(np.mean(np.asarray(discrete.ravel() - wanted) ** 2))))

    compare(mass, centres, 0)
    for c in range(3):
        compare(momentum[c], [faces[a][1:-1] if a == c else centres[a] for a in range(3)], 1, c)
    compare(heat, centres, 2)
    return np.array(found)


def test_discrete_residuals_converge_at_second_order():
    with jax.enable_x64(True):
        order = np.log2(errors(8) / errors(16))
    # Order 2 in the limit; at 8 cells the next term is still seen.
    assert (order > 1.8).all(), order
    assert (order < 2.4).all(), order


def test_heat_and_mass_are_conserved_sums_are_fluxes_through_the_walls():
    rng = np.random.default_rng(0)
    grid = StaggeredGrid(LOWER, UPPER, (5, 4, 6))
    with jax.enable_x64(True):
        state = jax.tree.map(lambda a: jnp.asarray(rng.standard_normal(a.shape)), grid.zeros())
        mass, _, heat = discrete_residuals(state, grid, NUMBERS)
        volume = float(np.prod(grid.spacing))
        outflow = through_heat = 0.0
        for axis in range(3):
            area = volume / grid.spacing[axis]
            inner = tuple(slice(None) if a == axis else slice(1, -1) for a in range(3))
            velocity = np.moveaxis(np.asarray(state.velocity[axis][inner]), axis, 0)
            temperature = np.moveaxis(np.asarray(state.temperature[inner]), axis, 0)
            outflow += area * (velocity[-1] - velocity[0]).sum()
            for side, (ghost, first) in ((1, (-1, -2)), (-1, (0, 1))):
                mean = 0.5 * (temperature[ghost] + temperature[first])
                # Heat leaves down its gradient, along the outward normal on both sides.
                slope = (temperature[ghost] - temperature[first]) / grid.spacing[axis] / NUMBERS.peclet
                through_heat += area * (side * mean * velocity[-1 if side > 0 else 0] - slope).sum()
        assert float(mass.sum()) * volume == pytest.approx(outflow, abs=1e-12)
        assert float(heat.sum()) * volume == pytest.approx(through_heat, abs=1e-12)


def test_interpolation_is_exact_for_linear_fields_inside_and_beyond():
    knots, targets = np.linspace(0.0, 2.0, 6), np.array([-0.3, 0.0, 0.77, 2.0, 2.4])
    np.testing.assert_allclose(interpolation_matrix(knots, targets) @ (3 * knots - 1), 3 * targets - 1)


def test_scattered_and_tensor_evaluation_agree():
    grid = StaggeredGrid(LOWER, UPPER, (6, 5, 4))
    rng = np.random.default_rng(1)
    state = jax.tree.map(lambda a: jnp.asarray(rng.standard_normal(a.shape), jnp.float32), grid.zeros())
    axes = (np.linspace(0, 1.4, 4), np.linspace(0, 1, 3), np.linspace(0, 1, 5))
    mesh = np.stack([m.ravel() for m in np.meshgrid(*axes, indexing="ij")], -1).astype(np.float32)
    scattered, tensor = grid.at(state, jnp.asarray(mesh)), grid.on_grid(state, axes)
    np.testing.assert_allclose(scattered.temperature, tensor.temperature.ravel(), atol=2e-5)
    np.testing.assert_allclose(scattered.velocity, tensor.velocity.reshape(-1, 3), atol=2e-5)


def test_a_finer_level_of_zeros_leaves_a_linear_state_as_it_is():
    multigrid = zero_multigrid(StaggeredGrid(LOWER, UPPER, (8, 8, 8)))
    linear = multigrid.grids[0].of_fields(
        ((np.array([0.0, 1.4])), np.array([0.0, 1.0]), np.array([0.0, 1.0])),
        FlowValues(jnp.arange(8.0).reshape(2, 2, 2), jnp.zeros((2, 2, 2)), jnp.ones((2, 2, 2, 3))),
    )
    start = MultiGrid((linear, *multigrid.levels[1:]), multigrid.grids)
    fine = start.refined()
    assert [g.cells[0] for g in fine.grids] == [4, 8, 16]
    direct = prolong(linear, multigrid.grids[0], fine.finest)
    np.testing.assert_allclose(fine.state().temperature, direct.temperature, atol=1e-4)


def test_a_flat_axis_stays_one_cell_thick():
    grids = zero_multigrid(StaggeredGrid(LOWER, UPPER, (16, 1, 16))).grids
    assert [g.cells for g in grids] == [(4, 1, 4), (8, 1, 8), (16, 1, 16)]
