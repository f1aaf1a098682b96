"""A capture is a folder: images, metadata, and a manifest that is written last.

    captures/<id>/
        reference.tif       mean and standard deviation (flow.tif, dark.tif, flat.tif by its role)
        frames.tif          optional raw stack
        manifest.json       last: what was asked, what was granted, every frame, every verdict
        incomplete.json     only while the burst runs, or after it was cut short
        partial.tif         the moments so far, renewed every few seconds

A folder without a manifest is an interrupted capture: what it holds can be read, and is never a measurement.
"""

import contextlib
import hashlib
import os
import shutil
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import TypeAdapter

from app.errors import AirlensError, BadInputError
from app.experiment.capture_files import BurstImage, RawStack, decode_image, read_image, write_image
from app.experiment.folder import Experiment, finished, parse_manifest, read_manifest, write_manifest
from app.files.durable import make_folder, sync, write_json
from app.files.provenance import sha256
from app.files.reading import inside, reading
from app.files.toml import to_plain
from drivers.burst import Burst, BurstOutcome, CapturePlan
from drivers.capture import Taken

CHECKPOINT_S = 5.0
# As near as a camera grants what is asked of it.
MAX_SETTING_OFF = 0.01


@dataclass(frozen=True)
class Capture:
    """A capture as read back. `images` holds one image a view; `manifest` is empty for an interrupted one.

    `sha256` has the hash of every file as it was read, by name.
    """

    folder: Path
    role: str
    complete: bool
    images: tuple[BurstImage, ...]
    manifest: Mapping[str, Any]
    sha256: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class CapturePair:
    """The two captures that a measurement compares, and a second reference that was taken after them, or none.

    `bursts` are those of a sequence, without their pictures, where `flow` is their mean.
    """

    reference: Capture
    flow: Capture
    after: Capture | None = None
    bursts: tuple[Capture, ...] = ()

    @property
    def names(self) -> dict[str, str]:
        """The folders' names by their part in the measurement."""
        parts = {"reference": self.reference, "flow": self.flow, "after": self.after}
        return {part: capture.folder.name for part, capture in parts.items() if capture is not None}

    def _parts(self) -> Iterator[tuple[str, Capture]]:
        yield "reference", self.reference
        if self.bursts:
            yield from ((f"flow/{number}", burst) for number, burst in enumerate(self.bursts))
        else:
            yield "flow", self.flow
        if self.after is not None:
            yield "after", self.after

    @property
    def inputs(self) -> dict[str, dict[str, str]]:
        """Every file that was read, with its capture and its hash, as a result's manifest names them."""
        return {
            f"{role}/{name}": {
                "capture": capture.folder.name,
                "file": name,
                "sha256": digest,
            }
            for role, capture in self._parts()
            for name, digest in capture.sha256.items()
        }


def newest_pair(experiment: Experiment) -> CapturePair:
    """The newest finished reference and flow; of a flow between two references, both of these.

    Raises BadInputError when one is missing or not as it was kept.
    """
    newest = experiment.latest_capture("reference")
    flow, bursts = _mean_flow(experiment, experiment.latest_capture("flow"))
    around = _references_around(experiment, flow)
    if around is None:
        return CapturePair(load_capture(newest), flow, bursts=bursts)
    before, after = around
    return CapturePair(load_capture(before), flow, load_capture(after), bursts)


def _mean_flow(experiment: Experiment, newest: Path) -> tuple[Capture, tuple[Capture, ...]]:
    """The newest flow; where it is of a sequence, the mean of its bursts, and these without their pictures."""
    sequence = _sequence_of(read_manifest(newest))
    if sequence is None:
        return load_capture(newest), ()
    others = {folder: read_manifest(folder) for folder in finished(experiment.captures_folder)}
    whole = [
        folder
        for folder, about in others.items()
        if about.get("complete") and _sequence_of(about) == sequence
    ]
    return mean_capture(whole or [newest])


def _sequence_of(manifest: Mapping[str, Any]) -> str | None:
    return manifest.get("origin", {}).get("sequence", {}).get("id")


def mean_capture(folders: Sequence[Path]) -> tuple[Capture, tuple[Capture, ...]]:
    """The mean of captures, each frame of the same weight, and these without their pictures.

    It has the folder and the manifest of the last one. Raises BadInputError.
    """
    total: list[BurstImage] = []
    bursts: list[Capture] = []
    for folder in folders:
        capture = load_capture(folder)
        images = list(capture.images)
        total = [_together(*both) for both in zip(total, images, strict=True)] if bursts else images
        bursts.append(replace(capture, images=()))
    return replace(bursts[-1], images=tuple(total)), tuple(bursts) if len(bursts) > 1 else ()


def _together(first: BurstImage, second: BurstImage) -> BurstImage:
    """Mean of the frames of both, and their mean scatter within a burst."""
    frames = first.frames + second.frames
    share = np.float32(second.frames / frames)
    mean = first.mean + share * (second.mean - first.mean)
    variance = first.std**2 + share * (second.std**2 - first.std**2)
    return BurstImage(mean, np.sqrt(variance), frames)


def _references_around(experiment: Experiment, flow: Capture) -> tuple[Path, Path] | None:
    """The references of the series that a flow is of, where it has both and no newer reference was taken since."""
    series = flow.manifest.get("origin", {}).get("series")
    if series is None:
        return None
    places = {}
    for folder in finished(experiment.captures_folder):
        of = read_manifest(folder).get("origin", {}).get("series", {})
        if of.get("id") == series["id"]:
            places[of["place"]] = folder
    if not {0, 2} <= set(places) or experiment.latest_capture("reference") != places[2]:
        return None
    return places[0], places[2]


def write_capture(
    folder: Path,
    burst: Burst | Sequence[Burst],
    *,
    role: str | None = None,
    origin: Mapping[str, Any] | None = None,
) -> Path:
    """Write one burst (or one a view) as a finished capture and return the folder.

    `role` is the plan's kind unless given; `origin` (hashes, seed, ...) goes into the manifest as it is.
    """
    bursts = [burst] if isinstance(burst, Burst) else list(burst)
    role = role or bursts[0].plan.role
    views = []
    for number, one in enumerate(bursts):
        path = folder / image_name(role, number)
        write_image(path, BurstImage(one.mean, one.std, one.frames))
        views.append({"file": path.name, "sha256": sha256(path)} | describe_burst(one))
    raw = folder / "frames.tif"
    write_manifest(
        folder,
        {
            "schema_version": 1,
            "role": role,
            "complete": all(one.outcome is BurstOutcome.COMPLETE for one in bursts),
            "created": datetime.now(UTC).isoformat(timespec="seconds"),
            "views": views,
            "raw": {"file": raw.name, "sha256": sha256(raw)} if raw.exists() else None,
            "origin": dict(origin or {}),
        },
    )
    for leftover in ("incomplete.json", "partial.tif"):
        (folder / leftover).unlink(missing_ok=True)
    return folder


def image_name(role: str, view: int = 0) -> str:
    """File name of a view's image."""
    return f"{role}.tif" if view == 0 else f"{role}-{view}.tif"


def describe_burst(burst: Burst) -> dict[str, Any]:
    """Return everything but the images as plain data."""
    names = ("plan", "outcome", "camera", "full_scale_counts", "settings", "refused", "verdicts", "records")
    return {"frames": burst.frames} | {name: _plain(getattr(burst, name)) for name in names}


def load_capture(folder: Path) -> Capture:
    """Read a capture, finished or interrupted.

    Raises BadInputError when there is nothing to read, or when a file is not the one that was kept.
    """
    path = folder / "manifest.json"
    if path.exists():
        with reading(path, "Take the capture again, or restore it from a copy."):
            text = path.read_bytes()
            manifest = parse_manifest(text, path)
            read = {path.name: hashlib.sha256(text).hexdigest()}
            images = tuple(_kept_image(folder, view, read) for view in manifest["views"])
            return Capture(folder, manifest["role"], manifest["complete"], images, manifest, read)
    partial = folder / "partial.tif"
    if not partial.exists():
        raise BadInputError(
            f"{folder} holds no capture: it has no manifest.json and no partial.tif. "
            "The burst was interrupted before its first frames; take it again."
        )
    return Capture(folder, "interrupted", False, (read_image(partial),), {})


def _kept_image(folder: Path, view: Mapping[str, Any], read: dict[str, str]) -> BurstImage:
    """One view's image, read once; its hash is held against the manifest's and noted in `read`."""
    path = inside(folder, view["file"])
    try:
        content = path.read_bytes()
    except OSError as error:
        raise BadInputError(
            f"{path} cannot be read ({error.strerror}); restore it from a copy, or take the capture again."
        ) from None
    found, kept = hashlib.sha256(content).hexdigest(), view.get("sha256")
    if found != kept:
        raise BadInputError(
            f"{path} is not the file that was kept: its SHA-256 is {found}, and {folder / 'manifest.json'} says "
            f"{kept}. Restore the file from a copy, or take the capture again."
        )
    read[path.name] = found
    return decode_image(content, path)


def reserve(folder: Path, plan: CapturePlan) -> None:
    """Make the folder of a capture that is about to begin: from now on a crash leaves it as an interrupted one.

    Nothing stays when the disk refuses it (OSError). Raises BadInputError when the experiment is gone.
    """
    if not folder.parent.parent.is_dir():
        raise BadInputError(
            f"There is no {folder.parent.parent} any more: nothing can be taken into it. Restore the experiment, "
            "or make another one."
        )
    make_folder(folder.parent)
    folder.mkdir()
    try:
        sync(folder.parent)
        started = datetime.now(UTC).isoformat(timespec="seconds")
        about = {"role": plan.role, "plan": to_plain(plan), "started": started, "process": os.getpid()}
        write_json(folder / "incomplete.json", about)
    except OSError:
        shutil.rmtree(folder, ignore_errors=True)
        raise


def release(folder: Path) -> None:
    """Remove the folder of a capture that never had a frame; any other one stays as it is."""
    with contextlib.suppress(OSError):
        if [path.name for path in folder.iterdir()] == ["incomplete.json"]:
            shutil.rmtree(folder, ignore_errors=True)


class CaptureRecorder:
    """Follows a burst while it runs, so that a crash leaves what was taken before, marked as incomplete.

    Hand `observe` to `run_capture` as `on_frame`; then call `keep` or `discard`.
    """

    def __init__(self, folder: Path, plan: CapturePlan, checkpoint_s: float = CHECKPOINT_S) -> None:
        if not (folder / "incomplete.json").exists():
            reserve(folder, plan)
        self.folder, self._checkpoint_s = folder, checkpoint_s
        self._saved_s = float("-inf")
        self._stack = RawStack(folder / "frames.tif") if plan.raw_stack else None

    def observe(self, taken: Taken) -> None:
        """Append to the raw stack; renew the moments when their time has come."""
        if self._stack:
            self._stack.add(taken.frame, taken.record)
        began_s = time.monotonic()
        if began_s - self._saved_s < self._checkpoint_s:
            return
        self._check()
        full_scale = taken.frame.full_scale_counts
        moments = taken.moments
        image = BurstImage(moments.mean(full_scale), moments.std(full_scale), moments.frames)
        write_image(self.folder / "partial.tif", image)
        # A slow disk must not slow the burst down: at most a tenth of the time goes into checkpoints.
        self._saved_s = time.monotonic()
        self._checkpoint_s = max(self._checkpoint_s, 10 * (self._saved_s - began_s))

    def keep(self, bursts: Sequence[Burst], origin: Mapping[str, Any] | None = None, views: int = 1) -> Path:
        """Finish the folder, a burst a view. What a device cut short, or lacks a view, gets no manifest.

        It is no measurement.
        """
        self._close()
        self._check()
        burst = bursts[-1]
        if len(bursts) == views and burst.outcome in (BurstOutcome.COMPLETE, BurstOutcome.ABORTED):
            return write_capture(self.folder, bursts, origin=origin)
        write_image(self.folder / "partial.tif", BurstImage(burst.mean, burst.std, burst.frames))
        write_json(self.folder / "incomplete.json", {"role": burst.plan.role} | describe_burst(burst))
        return self.folder

    def discard(self) -> None:
        """Remove the folder and what was taken."""
        self._close()
        shutil.rmtree(self.folder)

    def leave(self) -> None:
        """End without a burst: frames stay as an interrupted capture; where there are none, nothing stays."""
        self._close()
        if not any((self.folder / name).exists() for name in ("partial.tif", "manifest.json")):
            shutil.rmtree(self.folder, ignore_errors=True)

    def _check(self) -> None:
        """Raise AirlensError when somebody has removed the folder: what is written now would be of no use."""
        if not (self.folder / "incomplete.json").exists():
            raise AirlensError(
                f"The folder {self.folder} was removed while its capture was taken; nothing of it is kept. "
                "Take it again."
            )

    def _close(self) -> None:
        if self._stack:
            self._stack.close()
            self._stack = None


def _plain(value: Any) -> Any:
    return TypeAdapter(Any).dump_python(value, mode="json")
