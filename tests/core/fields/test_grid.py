import jax
import jax.numpy as jnp
import numpy as np
import pytest

from core.fields import GridField
from core.setting import SettingError


def field() -> GridField:
    values = np.random.default_rng(0).normal(size=(4, 5, 6)).astype(np.float32)
    return GridField((0.0, -1.0, 0.5), (1.0, 1.0, 2.0), values)


def test_vertex_values_come_back_at_vertices():
    x, y, z = np.meshgrid(np.linspace(0, 1, 4), np.linspace(-1, 1, 5), np.linspace(0.5, 2, 6), indexing="ij")
    points = jnp.asarray(np.stack([x, y, z], -1).reshape(-1, 3), jnp.float32)

    assert np.allclose(field().excess(points), field().values.ravel(), atol=2e-6)


def test_a_function_linear_on_each_axis_is_reproduced_with_its_gradient():
    x, y, z = np.meshgrid(np.linspace(0, 1, 4), np.linspace(-1, 1, 5), np.linspace(0.5, 2, 6), indexing="ij")
    linear = GridField((0.0, -1.0, 0.5), (1.0, 1.0, 2.0), (2 * x - 3 * y + 0.5 * z).astype(np.float32))

    value, gradient = linear.excess_and_gradient(jnp.asarray([[0.3, 0.1, 1.7], [0.9, -0.7, 0.6]]))

    assert np.allclose(value, [2 * 0.3 - 0.3 + 0.85, 1.8 + 2.1 + 0.3], atol=1e-5)
    assert np.allclose(gradient, [[2, -3, 0.5]] * 2, atol=1e-4)


def test_gradient_is_that_of_the_value():
    points = jax.random.uniform(
        jax.random.key(1), (40, 3), minval=jnp.asarray([0, -1, 0.5]), maxval=jnp.asarray([1, 1, 2.0])
    )

    _, gradient = field().excess_and_gradient(points)

    automatic = jax.vmap(jax.grad(lambda x: field().excess(x[None])[0]))(points)
    assert np.allclose(gradient, automatic, rtol=1e-4, atol=1e-4)


def test_a_single_layer_of_vertices_is_refused():
    with pytest.raises(SettingError, match="at least 2"):
        GridField((0.0, 0.0, 0.0), (1.0, 1.0, 1.0), np.zeros((1, 4, 4), np.float32))
