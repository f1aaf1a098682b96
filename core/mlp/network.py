"""A multilayer perceptron from nondimensional position to nondimensional (T, p, u)."""

import itertools
import math

import equinox as eqx
import jax
import jax.numpy as jnp
from jax.typing import DTypeLike
from jaxtyping import Array, Float, PRNGKeyArray

from core.losses.boussinesq import FlowValues, Numbers, Residuals, residuals
from core.losses.representation import Spans, points_of
from core.mlp.propagation import Activation, activate, propagate_activation, propagate_linear
from core.setting import SettingError, setting

Corner = tuple[float, float, float]
OUTPUTS = 5  # T, p, u, v, w


@setting
class MlpSettings:
    """Size and kind of the network; `fourier_features` pairs of cos and sin, zero for none."""

    hidden_layers: int = 4
    width: int = 128
    activation: Activation = "tanh"
    fourier_features: int = 0
    fourier_scale: float = 1.0

    def __post_init__(self) -> None:
        if self.hidden_layers < 1 or self.width < 1 or self.fourier_features < 0:
            raise SettingError(
                f"Network of {self.hidden_layers} x {self.width}, {self.fourier_features} Fourier features; "
                "expected at least 1 x 1 and no negative count."
            )


class Mlp(eqx.Module):
    """(T, p, u) at any point of the box `lower` to `upper`, which is mapped to [-1, 1]^3 first.

    Fourier features, if any, are cos and sin of 2π B x with a fixed random B (Tancik et al. 2020).
    """

    weights: tuple[Float[Array, "_ _"], ...]
    biases: tuple[Float[Array, " _"], ...]
    frequencies: Float[Array, "3 features"] | None
    lower: Corner = eqx.field(static=True)
    upper: Corner = eqx.field(static=True)
    activation: Activation = eqx.field(static=True)

    def at(self, points_nd: Float[Array, "points 3"]) -> FlowValues:
        """Values."""
        hidden = self._normalised(points_nd)
        if self.frequencies is not None:
            phase = hidden @ jax.lax.stop_gradient(self.frequencies)
            hidden = jnp.concatenate([jnp.cos(phase), jnp.sin(phase)], axis=1)
        for weight, bias in zip(self.weights[:-1], self.biases[:-1], strict=True):
            hidden = activate(self.activation, hidden @ weight + bias[None, :])
        return _split(hidden @ self.weights[-1] + self.biases[-1][None, :])

    def with_derivatives(
        self, points_nd: Float[Array, "points 3"]
    ) -> tuple[FlowValues, FlowValues, FlowValues]:
        """Values, gradients (last axis x, y, z) and Laplacians, in nondimensional coordinates."""
        stack = self._input_stack(points_nd)
        for weight, bias in zip(self.weights[:-1], self.biases[:-1], strict=True):
            stack = propagate_activation(self.activation, propagate_linear(stack, weight, bias))
        stack = propagate_linear(stack, self.weights[-1], self.biases[-1])
        gradient = jnp.moveaxis(stack[1:4], 0, -1)
        return (
            _split(stack[0]),
            FlowValues(gradient[:, 0], gradient[:, 1], gradient[:, 2:]),
            _split(stack[4]),
        )

    def fields(self) -> "Mlp":
        """Itself: there is nothing to share between losses."""
        return self

    def on_grid(self, spans: Spans) -> FlowValues:
        """T, p, u on a tensor grid of points."""
        shape = tuple(span[2] for span in spans)
        found = self.at(jnp.asarray(points_of(spans), self.biases[0].dtype))
        return jax.tree.map(lambda a: a.reshape(*shape, *a.shape[1:]), found)

    def residuals(self, numbers: Numbers, points_nd: Float[Array, "points 3"] | None) -> Residuals:
        """The continuous residuals at the points, which a network always needs."""
        if points_nd is None:
            raise SettingError(
                "A network has no cells of its own: give collocation points for its residuals."
            )
        return jax.vmap(residuals, (0, 0, 0, None))(*self.with_derivatives(points_nd), numbers)

    def _normalised(self, points_nd: Float[Array, "points 3"]) -> Float[Array, "points 3"]:
        lower, upper = (jnp.array(corner, points_nd.dtype)[None, :] for corner in (self.lower, self.upper))
        return 2.0 * (points_nd - lower) / (upper - lower) - 1.0

    def _input_stack(self, points_nd: Float[Array, "points 3"]) -> Float[Array, "5 points inputs"]:
        position = self._normalised(points_nd)
        slopes = [2.0 / (u - low) for low, u in zip(self.lower, self.upper, strict=True)]
        jacobian = jnp.broadcast_to(
            jnp.diag(jnp.array(slopes, position.dtype))[:, None], (3, *position.shape)
        )
        stack = jnp.concatenate([position[None], jacobian, jnp.zeros_like(position)[None]])
        if self.frequencies is None:
            return stack
        # sin(z + π/2) is cos(z): both features are one activation of a doubled linear layer.
        frequencies = jax.lax.stop_gradient(self.frequencies)
        phase = jnp.repeat(jnp.array([math.pi / 2, 0.0], position.dtype), frequencies.shape[1])
        stack = propagate_linear(stack, jnp.concatenate([frequencies, frequencies], axis=1), phase)
        return propagate_activation("sine", stack)


def initial_mlp(
    settings: MlpSettings, lower: Corner, upper: Corner, key: PRNGKeyArray, dtype: DTypeLike = jnp.float32
) -> Mlp:
    """Glorot-normal weights and zero biases; for `sine` the uniform start of Sitzmann et al. (2020)."""
    key, feature_key = jax.random.split(key)
    count = settings.fourier_features
    frequencies = None
    if count:
        scale = 2.0 * math.pi * settings.fourier_scale
        frequencies = scale * jax.random.normal(feature_key, (3, count), dtype)
    sizes = [2 * count or 3, *[settings.width] * settings.hidden_layers, OUTPUTS]
    weights = []
    for layer, (fan_in, fan_out) in enumerate(itertools.pairwise(sizes)):
        layer_key = jax.random.fold_in(key, layer)
        if settings.activation == "sine":
            bound = 6.0 / fan_in if layer == 0 else math.sqrt(6.0 / fan_in)
            weights.append(jax.random.uniform(layer_key, (fan_in, fan_out), dtype, -bound, bound))
        else:
            scale = math.sqrt(2.0 / (fan_in + fan_out))
            weights.append(scale * jax.random.normal(layer_key, (fan_in, fan_out), dtype))
    biases = tuple(jnp.zeros(size, dtype) for size in sizes[1:])
    return Mlp(tuple(weights), biases, frequencies, lower, upper, settings.activation)


def _split(outputs: Float[Array, "points 5"]) -> FlowValues:
    return FlowValues(outputs[:, 0], outputs[:, 1], outputs[:, 2:])
