import jax
import jax.numpy as jnp
import numpy as np
import pytest

from core.losses.boussinesq import FlowValues
from core.mlp import MlpSettings, initial_mlp
from core.setting import SettingError

LOWER, UPPER = (0.0, -0.5, 0.1), (1.4, 0.5, 1.1)


def build(dtype=jnp.float32, **settings):
    return initial_mlp(
        MlpSettings(hidden_layers=3, width=16, **settings), LOWER, UPPER, jax.random.key(5), dtype
    )


def nested(network, points):
    def one(point):
        return jax.tree.map(lambda a: a[0], network.at(point[None]))

    hessian = jax.vmap(jax.jacfwd(jax.jacfwd(one)))(points)
    return (
        jax.vmap(one)(points),
        jax.vmap(jax.jacfwd(one))(points),
        jax.tree.map(lambda h: jnp.trace(h, axis1=-2, axis2=-1), hessian),
    )


@pytest.mark.parametrize(
    "settings",
    [{}, {"activation": "swish"}, {"activation": "sine"}, {"fourier_features": 6}],
    ids=["tanh", "swish", "sine", "fourier"],
)
def test_propagated_derivatives_equal_nested_ones_in_float64(settings):
    with jax.enable_x64(True):
        network = build(jnp.float64, **settings)
        points = jax.random.uniform(jax.random.key(0), (7, 3), jnp.float64)
        found, expected = jax.jit(lambda p: (network.with_derivatives(p), nested(network, p)))(points)
    for ours, theirs in zip(jax.tree.leaves(found), jax.tree.leaves(expected), strict=True):
        np.testing.assert_allclose(ours, theirs, rtol=1e-9, atol=1e-9)


def test_values_with_and_without_derivatives_agree():
    network = build(fourier_features=4)
    points = jax.random.uniform(jax.random.key(0), (9, 3))
    # cos(z) against sin(z + pi/2): one float32 rounding of the phase.
    for plain, carried in zip(
        jax.tree.leaves(network.at(points)), jax.tree.leaves(network.with_derivatives(points)[0]), strict=True
    ):
        np.testing.assert_allclose(plain, carried, atol=2e-6)


def test_fourier_frequencies_are_fixed():
    network = build(fourier_features=4)
    points = jax.random.uniform(jax.random.key(0), (5, 3))

    def loss(net):
        flow: FlowValues = net.with_derivatives(points)[2]
        return (flow.velocity**2).sum() + (net.at(points).temperature ** 2).sum()

    gradient = jax.grad(loss)(network)
    assert float(jnp.abs(gradient.frequencies).max()) == 0.0
    assert float(jnp.abs(gradient.weights[0]).max()) > 0.0


def test_an_empty_network_is_refused():
    with pytest.raises(SettingError, match="0 x 16"):
        MlpSettings(hidden_layers=0, width=16)
