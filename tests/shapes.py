"""Shapes in signatures are checked at every call, each once.

jaxtyping's own wrapper binds the arguments of every call and checks them a second time beside what is returned: a
calibration takes half as long again. This one lets beartype check both once; named axes have one size in a call as
there.
"""

import inspect
from functools import wraps

import jaxtyping
from beartype import beartype
from jaxtyping import _decorator
from jaxtyping._storage import pop_shape_memo, push_shape_memo

_theirs = _decorator.jaxtyped


def check_each_once() -> None:
    """Wrap what is imported after this by ours, where `--jaxtyping-packages` asks for `jaxtyping.jaxtyped`."""
    _decorator.jaxtyped = jaxtyping.jaxtyped = _jaxtyped


def _jaxtyped(*given, typechecker):
    if not given or not inspect.isfunction(given[0]):
        # A class or a property: comes back with its functions.
        return _theirs(*given, typechecker=typechecker)
    checked = beartype(given[0])

    @wraps(given[0])
    def once(*arguments, **named):
        __tracebackhide__ = True
        push_shape_memo({})
        try:
            return checked(*arguments, **named)
        finally:
            pop_shape_memo()

    return once
