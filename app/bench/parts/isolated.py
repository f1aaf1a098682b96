"""One function in a process of its own, so that its memory and its compilation are its own."""

import multiprocessing
import resource
from collections.abc import Callable
from typing import Any, ParamSpec, TypeVar

Result = TypeVar("Result")
Given = ParamSpec("Given")


def alone(
    function: Callable[Given, Result], *args: Given.args, **named: Given.kwargs
) -> tuple[Result, float]:
    """What a module's function returns in a fresh process, and that process's peak memory [MB]."""
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        return pool.apply(_told, (function, args, named))


def _told(
    function: Callable[..., Result], args: tuple[Any, ...], named: dict[str, Any]
) -> tuple[Result, float]:
    result = function(*args, **named)
    return result, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
