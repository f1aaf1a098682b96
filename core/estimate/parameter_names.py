"""Fitted parameters as an operator reads them: `supply 1: velocity ratio` and its value."""

import numpy as np
from jax.flatten_util import ravel_pytree
from jaxtyping import Float

from core.estimate.prior import Prior
from core.geometry import WALLS

_ABOVE = "temperature above ambient (K)"
_WORDS = {
    "inlet_excess_k": ("supply {n}", _ABOVE),
    "inlet_log_flow": ("supply {n}", "velocity ratio"),
    "log_heat": ("walls", "heat coefficient ratio"),
    "wall_excess_k": ("wall {wall}", _ABOVE),
    "wall_log_heat": ("wall {wall}", "heat coefficient ratio"),
    "heater_excess_k": ("heater {n}", _ABOVE),
    "heater_log_heat": ("heater {n}", "heat coefficient ratio"),
    "log_closure": ("air", "eddy viscosity ratio"),
    "object_power_w": ("object {n}", "heat (W)"),
    "object_excess_k": ("object {n}", _ABOVE),
    "object_log_heat": ("object {n}", "heat coefficient ratio"),
    "log_viscosity": ("air, part {n}", "eddy viscosity ratio"),
}


def by_name(prior: Prior, vector: Float[np.ndarray, " active"]) -> dict[str, float]:
    """Value of every fitted parameter by its name: kelvin, or the ratio to what was taken before the fit."""
    chosen = prior.active()
    mean, std = (np.asarray(ravel_pytree(of)[0], float)[chosen] for of in (prior.mean, prior.std))
    found: dict[str, float] = {}
    for name, start, moved in zip(prior.names(), mean, vector * std, strict=True):
        ratio = "log" in name
        found[_readable(name, prior)] = float(np.exp(moved) if ratio else start + moved)
    return found


def _readable(name: str, prior: Prior) -> str:
    """`inlet_log_flow[0]` in words."""
    stem, _, index = name.rstrip("]").partition("[")
    n = int(index or 0)
    what, of = _WORDS[stem]
    wall = WALLS[n % len(WALLS)]
    tied = prior.tied()
    if tied and wall in tied:
        wall = " and ".join(tied)
    return f"{what.format(n=n + 1, wall=wall)}: {of}"
