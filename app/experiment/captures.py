"""A capture is a folder: images, metadata, and a manifest that is written last.

    captures/<id>/
        reference.tif       mean and standard deviation (flow.tif, dark.tif, flat.tif by its role)
        frames.tif          optional raw stack
        manifest.json       last: what was asked, what was granted, every frame, every verdict
        incomplete.json     only while the burst runs, or after it was cut short
        partial.tif         the moments so far, renewed every few seconds
        part-1.json         of several views, what is known of one that is there while another is missing

A folder without a manifest is an interrupted capture: what it holds can be read, and is never a measurement.
"""

import hashlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import TypeAdapter

from app.errors import BadInputError
from app.experiment.capture_files import BurstImage, decode_image, read_image, write_image
from app.experiment.folder import Experiment, finished, parse_manifest, read_manifest, write_manifest
from app.files.provenance import sha256
from app.files.reading import inside, reading
from drivers.burst import Burst, BurstOutcome

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
    complete = all(one.outcome is BurstOutcome.COMPLETE for one in bursts)
    finish(folder, role, views, complete, origin or {})
    return folder


def finish(
    folder: Path, role: str, views: Sequence[Mapping[str, Any]], complete: bool, origin: Mapping[str, Any]
) -> None:
    """Write the manifest of a capture whose pictures are there; `views` say what is known of each."""
    raw = folder / "frames.tif"
    write_manifest(
        folder,
        {
            "schema_version": 1,
            "role": role,
            "complete": complete,
            "created": datetime.now(UTC).isoformat(timespec="seconds"),
            "views": list(views),
            "raw": {"file": raw.name, "sha256": sha256(raw)} if raw.exists() else None,
            "origin": dict(origin),
        },
    )
    for leftover in ("incomplete.json", "partial.tif"):
        (folder / leftover).unlink(missing_ok=True)


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


def _plain(value: Any) -> Any:
    return TypeAdapter(Any).dump_python(value, mode="json")
