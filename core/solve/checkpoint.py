"""The state of a solve as bytes: one line of JSON, then the leaves. No pickle.

The header holds schema, configuration hash, step, seed, length of the history so far, versions and the
sha256 of the leaves. A checkpoint of another configuration, or one that was cut off, is refused.
"""

import hashlib
import io
import json
from typing import Any, NamedTuple, Protocol, TypeVar, runtime_checkable

import equinox as eqx
import jax
import numpy as np

from core.setting import SettingError

SCHEMA = 1
State = TypeVar("State")


class Checkpoint(NamedTuple):
    """A header and the serialised leaves."""

    header: dict[str, Any]
    leaves: bytes


@runtime_checkable
class CheckpointStore(Protocol):
    """Where checkpoints are kept: newest first on reading; a torn one is simply followed by an older."""

    def save(self, content: bytes) -> None:
        """Keep a checkpoint durably."""
        ...

    def load(self) -> list[bytes]:
        """What is there, newest first; empty for a fresh start."""
        ...


def configuration_hash(*settings: object) -> str:
    """A short hash of settings whose `repr` is their whole content (frozen dataclasses)."""
    return hashlib.sha256("\n".join(map(repr, settings)).encode()).hexdigest()[:16]


def encode(
    state: eqx.Module,
    *,
    configuration: str,
    step: int,
    seed: int,
    history: list[dict],
    shape: dict[str, int] | None = None,
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
        "shape": shape or {},
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
    """The state, shaped like `like`. Raises SettingError if another configuration made it."""
    if found.header["configuration"] != configuration:
        raise SettingError(
            f"The checkpoint belongs to configuration {found.header['configuration']}, not {configuration}: "
            "the problem or the settings were changed. Delete it to start afresh, or undo the change."
        )
    return eqx.tree_deserialise_leaves(io.BytesIO(found.leaves), like)


def newest(store: CheckpointStore) -> Checkpoint | None:
    """The newest whole checkpoint; None where there is none at all. Raises where none of several is whole."""
    contents = store.load()
    refused = None
    for content in contents:
        try:
            return decode(content)
        except SettingError as error:
            refused = error
    if refused is not None:
        raise refused
    return None
