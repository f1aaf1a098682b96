"""The state of a solve as bytes: one line of JSON, then the leaves. No pickle.

The header holds schema, configuration hash, step, seed, length of the history so far, versions and the
sha256 of the leaves. A checkpoint of another configuration, or one that was cut off, is refused.
"""

import dataclasses
import hashlib
import io
import json
from collections.abc import Iterator, Mapping, Sequence
from enum import Enum
from typing import Any, NamedTuple, TypeVar

import equinox as eqx
import jax
import numpy as np
from jaxtyping import PyTree

from core.setting import SettingError
from core.watch import Row, Store

SCHEMA = 1
KEPT = 2
State = TypeVar("State")


class Checkpoint(NamedTuple):
    """A header and the serialised leaves."""

    header: dict[str, Any]
    leaves: bytes


class ForeignCheckpointError(SettingError):
    """The checkpoint was made from another problem or by other settings."""


def digest(*things: object) -> str:
    """A short hash of settings and data: of every field of a dataclass, every bit of an array.

    Raises TypeError for what has no content of its own, such as a function.
    """
    found = hashlib.sha256()
    for piece in _pieces(things):
        found.update(piece)
    return found.hexdigest()[:16]


def encode(
    state: PyTree,
    *,
    configuration: str,
    step: int,
    seed: int,
    history: Sequence[Row],
    shape: Mapping[str, int | str] | None = None,
) -> bytes:
    """The checkpoint of a state; `shape` is what a reader must know to build one like it."""
    buffer = io.BytesIO()
    eqx.tree_serialise_leaves(buffer, state)
    leaves = buffer.getvalue()
    header = {
        "schema": SCHEMA,
        "configuration": configuration,
        "step": step,
        "seed": seed,
        "shape": dict(shape or {}),
        "history_offset": len(history),
        "history": history,
        "versions": {"jax": jax.__version__, "equinox": eqx.__version__, "numpy": np.__version__},
        "sha256": hashlib.sha256(leaves).hexdigest(),
    }
    return json.dumps(header).encode() + b"\n" + leaves


def decode(content: bytes) -> Checkpoint:
    """Header and leaves. Raises SettingError for anything cut off or altered."""
    line, _, leaves = content.partition(b"\n")
    try:
        header = json.loads(line)
        expected = header["sha256"]
    except (ValueError, KeyError, TypeError):
        raise SettingError("The checkpoint has no readable header; delete it to start afresh.") from None
    if header.get("schema") != SCHEMA:
        raise SettingError(
            f"The checkpoint has schema {header.get('schema')}, expected {SCHEMA}; it was made by another "
            "version. Delete it to start afresh."
        )
    if hashlib.sha256(leaves).hexdigest() != expected:
        raise SettingError("The checkpoint was cut off or altered (its sha256 differs); delete it.")
    return Checkpoint(header, leaves)


def restore(found: Checkpoint, like: State, *, configuration: str) -> State:
    """The state, shaped like `like`. Raises ForeignCheckpointError if another configuration made it."""
    refuse_foreign(found.header["configuration"], configuration)
    return eqx.tree_deserialise_leaves(io.BytesIO(found.leaves), like)


def refuse_foreign(found: str, configuration: str) -> None:
    """Raise ForeignCheckpointError unless a checkpoint's configuration is this one."""
    if found != configuration:
        raise ForeignCheckpointError(
            f"The checkpoint belongs to configuration {found}, not {configuration}: "
            "the problem or the settings were changed. Delete it to start afresh, or undo the change."
        )


def claim(store: Store, configuration: str) -> None:
    """Say whose a store is, before anything is kept in it. Raises ForeignCheckpointError where it is another's."""
    refuse_foreign(store.get("configuration", configuration.encode()).decode(), configuration)
    store["configuration"] = configuration.encode()


def keep(store: Store, content: bytes) -> None:
    """Keep the newest checkpoint of a solve, and the one before it."""
    numbers = _numbers(store)
    store[f"{int(numbers[0]) + 1 if numbers else 1:08d}"] = content
    for old in numbers[KEPT - 1 :]:
        store.pop(old, None)


def newest(store: Store) -> Checkpoint | None:
    """The newest whole checkpoint; None where there is none at all. Raises where none of several is whole."""
    refused = None
    for number in _numbers(store):
        try:
            return decode(store[number])
        except SettingError as error:
            refused = error
    if refused is not None:
        raise refused
    return None


def _numbers(store: Store) -> list[str]:
    """Names of what `keep` kept, newest first."""
    return sorted((name for name in store if name.isdigit()), reverse=True)


def _pieces(thing: object) -> Iterator[bytes]:
    """What a thing consists of, each part with its kind and size, so that no two things read alike."""
    match thing:
        case None | bool() | int() | float() | str() | bytes() | Enum():
            yield f"{type(thing).__name__} {thing!r};".encode()
        case np.ndarray() | np.generic() | jax.Array():
            array = np.asarray(thing)
            yield f"{array.dtype} {array.shape};".encode()
            yield array.tobytes()
        case tuple() | list():
            yield f"{len(thing)} of;".encode()
            for item in thing:
                yield from _pieces(item)
        case _ if dataclasses.is_dataclass(thing) and not isinstance(thing, type):
            yield f"{type(thing).__qualname__};".encode()
            for field in dataclasses.fields(thing):
                yield f"{field.name}=".encode()
                yield from _pieces(getattr(thing, field.name))
        case _:
            raise TypeError(f"{type(thing).__name__} has no content to be told apart by.")
