import jax.numpy as jnp
import numpy as np
import pytest

from core.solve.grid.gauss_newton import gauss_newton_step


def rosenbrock(z, data):
    return {"a": 10.0 * (z["y"] - z["x"] ** 2), "b": data - z["x"]}


def test_a_linear_problem_of_unlike_units_is_solved_in_one_step():
    rng = np.random.default_rng(0)
    matrix = jnp.asarray(rng.standard_normal((30, 4)), jnp.float32)
    target = jnp.asarray(rng.standard_normal(30), jnp.float32)

    def rows(z, data):
        return matrix[:, :2] @ z[0] + 1e4 * (matrix[:, 2:] @ z[1]) - data

    step = gauss_newton_step(rows, (jnp.zeros(2), jnp.zeros(2)), target, jnp.float32(0), 20, 1e-6)
    exact = np.linalg.lstsq(np.asarray(matrix), np.asarray(target))[0]
    found = np.concatenate([step.unknowns[0], 1e4 * np.asarray(step.unknowns[1])])
    # The leaves' columns differ by 1e4; without scaling float32 CG would lose the first pair.
    np.testing.assert_allclose(found, exact, rtol=2e-3, atol=1e-4)
    assert float(step.cost_after) < float(step.cost_before)


def test_rosenbrock_falls_to_rounding():
    z = {"x": jnp.full(1, -1.2), "y": jnp.full(1, 1.0)}
    one = jnp.ones(1)
    damping = 1e-3
    for _ in range(30):
        step = gauss_newton_step(rosenbrock, z, one, jnp.float32(damping), 10, 1e-6)
        if float(step.cost_after) < float(step.cost_before):
            z, damping = step.unknowns, damping / 5
        else:
            damping *= 10
    assert float(z["x"][0]) == pytest.approx(1.0, abs=1e-3)
    assert float(z["y"][0]) == pytest.approx(1.0, abs=1e-3)
