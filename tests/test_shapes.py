"""A wrong shape in the packages' signatures fails at the call: of an argument, of a named axis, of a result."""

import numpy as np
import pytest
from beartype import beartype
from beartype.roar import BeartypeCallHintParamViolation, BeartypeCallHintReturnViolation
from jaxtyping import Float, jaxtyped

from core import lens
from core.geometry import Box


def test_an_argument_of_another_shape_or_type_is_refused():
    with pytest.raises(BeartypeCallHintParamViolation):
        lens.directions(np.eye(4), np.zeros(5), np.zeros((7, 2)))
    with pytest.raises(BeartypeCallHintParamViolation):
        Box(lower_m="none", upper_m=(1.0, 1.0, 1.0))


def test_a_named_axis_has_one_size_in_a_call_and_another_in_the_next():
    with pytest.raises(BeartypeCallHintParamViolation):
        lens._distorted(np.zeros(7), np.zeros(8), np.zeros(5))
    for points in (7, 8):
        assert lens._distorted(np.zeros(points), np.zeros(points), np.zeros(5)).shape == (2, points)


def test_a_result_of_another_size_than_its_argument_is_refused():
    @jaxtyped(typechecker=beartype)
    def shorter(points_m: Float[np.ndarray, " points"]) -> Float[np.ndarray, " points"]:
        return points_m[1:]

    with pytest.raises(BeartypeCallHintReturnViolation):
        shorter(np.zeros(7))
