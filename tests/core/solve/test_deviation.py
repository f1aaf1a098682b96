"""How uncertain a draft is, against the inverse of its Hessian."""

from dataclasses import dataclass

import numpy as np
import pytest
from jaxtyping import Float

from core.geometry import Box
from core.known_temperature import KnownTemperature, VertexGrid
from core.shared_errors import broad
from core.solve.draft.temperature_deviation import deviation
from core.solve.draft.temperature_system import AirPart, System, Volume

SHAPE = (5, 4, 6)
GRID = VertexGrid(Box(lower_m=(0.0, 0.0, 0.0), upper_m=(4.0, 3.0, 3.0)), SHAPE)


@dataclass(frozen=True)
class Steps:
    """Shows how each vertex differs from the one beside it, and so many times how from the one above it."""

    vertical: float

    def apply(self, values: Volume) -> Float[np.ndarray, "windows 2"]:
        across, up = np.diff(values, axis=0)[:, :, 1:], np.diff(values, axis=2)[1:]
        return np.stack([across.ravel(), self.vertical * up.ravel()], axis=1)

    def transpose(self, displacement_px: Float[np.ndarray, "windows 2"]) -> Volume:
        across, up = displacement_px.T.reshape(2, SHAPE[0] - 1, SHAPE[1], SHAPE[2] - 1)
        total = np.zeros(SHAPE)
        total[1:, :, 1:] += across
        total[:-1, :, 1:] -= across
        total[1:, :, 1:] += self.vertical * up
        total[1:, :, :-1] -= self.vertical * up
        return total


def system(vertical: float) -> System:
    """Air whose mean a thermometer tells to 0.3 and whose profile is free to rise."""
    operator, weight = Steps(vertical), np.broadcast_to(400.0 * np.eye(2), (80, 2, 2))
    known = KnownTemperature(
        np.zeros(SHAPE, bool), np.zeros(SHAPE), np.ones(SHAPE), ((np.arange(120), 0.0, 0.3),)
    )
    part = AirPart(100.0, (100.0, 100.0, 100.0))
    return System(GRID, (operator,), (1,), (operator,), (weight,), known, 1.0, (part,), {}, 5.0)


@pytest.mark.parametrize("vertical", [0.0, 1.0], ids=["the rise is not seen", "it is seen"])
def test_the_mean_and_the_rise_are_exact_however_few_the_draws(vertical):
    of = system(vertical)
    units = np.eye(120).reshape(120, *SHAPE)
    hessian = np.stack([of.data_terms(n) + of.known_terms(n) + of.smooth(n) for n in units]).reshape(120, 120)
    covariance = np.linalg.inv(hessian)

    found, shared = deviation(of, lambda n: (covariance @ n.ravel()).reshape(SHAPE), 2)

    exact = np.sqrt(np.diag(covariance)).reshape(SHAPE)
    assert found.mean(axis=(0, 1)) == pytest.approx(exact.mean(axis=(0, 1)), rel=0.2)
    mean, rise = broad(SHAPE).reshape(2, 120)
    together = shared.reshape(120, -1)
    assert (rise @ covariance @ rise > 0.25) == (vertical == 0.0)
    for of_all in (rise, mean):
        assert np.sum((of_all @ together) ** 2) == pytest.approx(of_all @ covariance @ of_all)
    assert (np.sum(shared**2, axis=-1) <= found**2).all()


def test_a_rise_that_goes_with_the_mean_alone_is_one_error():
    tied = (1.0 + np.broadcast_to(np.linspace(-0.5, 0.5, SHAPE[2]), SHAPE)).ravel()
    found, shared = deviation(system(1.0), lambda n: (tied * (tied @ n.ravel())).reshape(SHAPE), 1)
    assert shared.shape == (*SHAPE, 1)
    assert np.abs(shared.ravel()) == pytest.approx(tied)
    assert found.ravel() == pytest.approx(tied)
