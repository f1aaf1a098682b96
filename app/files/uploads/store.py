"""Keeps uploads: streamed to a hidden file, checked by headers, read by a child, published by rename."""

import asyncio
import hashlib
import json
import os
import secrets
import shutil
import subprocess
import sys
import time
from collections.abc import AsyncIterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from app.errors import BadInputError
from app.files.durable import write_durably, write_json
from app.files.npz import read_npy
from app.files.reading import read_json
from app.files.uploads.declared import HEAD_BYTES, HEADER_BYTES, Kind, check_head, declared_arrays

MANIFEST = "manifest.json"
AGAIN = "Delete the upload and send the file again."
# What a room volume has at least.
ROOM_ARRAYS = ("x", "y", "z", "T", "u", "p", "T0")
PICTURE_KINDS = ("png", "tiff", "jpeg")


@dataclass(frozen=True)
class UploadLimits:
    """What one upload may hold, and what reading it may take."""

    pixels: int
    unpacked_bytes: int
    parse_s: float
    parse_memory_bytes: int
    stored: int


class UploadStore:
    """Uploads in one folder, each a folder with `manifest.json` (written last) and one NPY an array."""

    def __init__(self, folder: Path, limits: UploadLimits) -> None:
        self._folder = folder
        self._limits = limits
        self._children = asyncio.Semaphore(2)
        folder.mkdir(parents=True, exist_ok=True)
        for left in folder.glob(".*"):
            shutil.rmtree(left, ignore_errors=True)

    def _folders(self) -> list[Path]:
        return [path.parent for path in self._folder.glob(f"u*/{MANIFEST}")]

    async def add(self, chunks: AsyncIterator[bytes], called: str = "") -> dict[str, Any]:
        """Return the manifest of a new upload; BadInputError, with nothing kept, if it cannot be used.

        `called` is what its sender calls the file.
        """
        if len(self._folders()) >= self._limits.stored:
            raise BadInputError(
                f"There are {self._limits.stored} uploads already. Delete some that are no longer needed."
            )
        name = f"u{secrets.token_hex(8)}"
        hidden = self._folder / f".{name}"
        hidden.mkdir()
        try:
            manifest = {"upload": name, "name": called, **await self._read(hidden, chunks)}
            await asyncio.to_thread(_publish, hidden, self._folder / name, manifest)
        finally:
            shutil.rmtree(hidden, ignore_errors=True)
        return manifest

    def list(self) -> list[dict[str, Any]]:
        """Return the manifests, newest first; one that cannot be read holds its name and the `reason` only.

        What has no manifest is unfinished and not shown.
        """
        found = []
        for folder in self._folders():
            try:
                found.append(read_json(folder / MANIFEST, AGAIN))
            except BadInputError as error:
                found.append({"upload": folder.name, "reason": str(error)})
        return sorted(found, key=_newest, reverse=True)

    def folder(self, upload: str) -> Path | None:
        """Return the folder of `upload` by listing, so that no path is made from what was asked."""
        return next((folder for folder in self._folders() if folder.name == upload), None)

    def room(self, upload: str) -> Path | None:
        """The room volume (NPZ) of an upload that holds one; packed when it is first asked for."""
        folder = self.folder(upload)
        if folder is None or not all((folder / f"{name}.npy").is_file() for name in ROOM_ARRAYS):
            return None
        packed = folder / "room.npz"
        if not packed.is_file():
            arrays = {path.stem: read_npy(path) for path in folder.glob("*.npy")}
            write_durably(packed, lambda temporary: _save(temporary, arrays))
        return packed

    def rooms(self) -> Sequence[str]:
        """The uploads that hold a room volume, newest first."""
        named = [str(manifest["upload"]) for manifest in self.list() if manifest.get("kind") == "npz"]
        return [upload for upload in named if self.room(upload) is not None]

    def pictures(self, upload: str) -> Mapping[Path, str]:
        """The arrays (NPY) of an upload that holds pictures, and what its sender calls each; empty for any other."""
        folder = self.folder(upload)
        if folder is None or self.kind(upload) not in PICTURE_KINDS:
            return {}
        manifest = read_json(folder / MANIFEST, AGAIN)
        arrays, called = manifest["arrays"], str(manifest.get("name") or upload)
        pages = [f", page {number}" if len(arrays) > 1 else "" for number in range(1, len(arrays) + 1)]
        return {folder / f"{one['name']}.npy": called + page for one, page in zip(arrays, pages, strict=True)}

    def kind(self, upload: str) -> str:
        """What kind of file it was; empty where there is no such upload."""
        folder = self.folder(upload)
        return "" if folder is None else str(read_json(folder / MANIFEST, AGAIN).get("kind"))

    def delete(self, upload: str) -> bool:
        """Remove an upload; False if there is none."""
        folder = self.folder(upload)
        if folder is not None:
            # Out of sight first: a half-removed one is never shown.
            hidden = folder.with_name(f".{folder.name}.{secrets.token_hex(8)}")
            folder.rename(hidden)
            shutil.rmtree(hidden)
        return folder is not None

    async def _read(self, hidden: Path, chunks: AsyncIterator[bytes]) -> dict[str, Any]:
        original = hidden / "original"
        kind, size_bytes, digest = await self._receive(original, chunks)
        limits = self._limits
        await asyncio.to_thread(declared_arrays, original, kind, limits.pixels, limits.unpacked_bytes)
        async with self._children:
            arrays = await asyncio.to_thread(read_in_child, kind, original, hidden, limits)
        original.unlink()
        return {
            "kind": kind,
            "bytes": size_bytes,
            "sha256": digest,
            "received_s": round(time.time(), 3),
            "arrays": arrays,
        }

    async def _receive(self, path: Path, chunks: AsyncIterator[bytes]) -> tuple[Kind, int, str]:
        digest = hashlib.sha256()
        head, kind, size_bytes = b"", None, 0
        with path.open("xb") as file:
            async for chunk in chunks:
                if kind is None:
                    head += chunk[:HEAD_BYTES]
                    kind = check_head(head, self._limits.pixels) if len(head) >= HEAD_BYTES else None
                digest.update(chunk)
                size_bytes += len(chunk)
                await asyncio.to_thread(_write, file, chunk)
        return kind or check_head(head, self._limits.pixels), size_bytes, digest.hexdigest()


def read_in_child(kind: Kind, source: Path, folder: Path, limits: UploadLimits) -> list[dict[str, Any]]:
    """Return what the child found; BadInputError if it refused, was killed, or took too long."""
    bounds = (limits.parse_memory_bytes, int(limits.parse_s) + 1, limits.unpacked_bytes + HEADER_BYTES)
    arguments = [kind, str(source), str(folder), *map(str, bounds)]
    try:
        # From a thread, not by the event loop: uvloop forks this process, whose other threads may hold locks.
        done = subprocess.run(
            [sys.executable, "-I", "-m", "app.files.uploads.child", *arguments],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            env={"PATH": os.defpath, "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"},
            timeout=limits.parse_s,
            check=False,
        )
    except subprocess.TimeoutExpired as error:
        raise BadInputError(
            f"The file was not read within {limits.parse_s:g} s. Send a smaller one."
        ) from error
    if done.returncode == 0:
        return json.loads(done.stdout)["arrays"]
    refused = json.loads(done.stdout)["reason"] if done.stdout else None
    reason = refused or "it needs more memory or time than is allowed"
    raise BadInputError(f"The file cannot be read: {reason}. Check it in the program that wrote it.")


def _save(path: Path, arrays: dict[str, np.ndarray]) -> None:
    with path.open("wb") as file:
        np.savez_compressed(file, **arrays)  # type: ignore[arg-type]


def _newest(manifest: dict[str, Any]) -> tuple[float, str]:
    received_s = manifest.get("received_s")
    return (received_s if isinstance(received_s, float) else 0.0, str(manifest.get("upload")))


def _write(file: BinaryIO, chunk: bytes) -> None:
    file.write(chunk)


def _publish(hidden: Path, final: Path, manifest: dict[str, Any]) -> None:
    for path in hidden.iterdir():
        with path.open("rb") as file:
            os.fsync(file.fileno())
    hidden.rename(final)
    write_json(final / MANIFEST, manifest)
