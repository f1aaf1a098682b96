"""A capture of several views before it is whole: each view's picture by itself, with what is known of it.

    captures/<id>/
        flow-1.tif          the picture of the second view
        part-1.json         its file and hash, what was asked and granted, its verdicts, and the view's name
        incomplete.json     the role, and the origin that the manifest will have

A part counts while the scene's view of its number has its name. Once no view is missing, the parts become the views
of the manifest, and the capture is a measurement.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from app.errors import BadInputError
from app.experiment.capture_files import BurstImage, write_image
from app.experiment.captures import describe_burst, finish, image_name
from app.experiment.folder import parse_manifest, read_manifest
from app.files.durable import write_json
from app.files.provenance import sha256
from app.files.reading import inside, reading
from app.files.toml import to_plain
from drivers.burst import Burst, CapturePlan

_WHAT_TO_DO = "Discard the capture and take it again."


@dataclass(frozen=True)
class CaptureParts:
    """The views that a capture has of those that it should have, by their number; what was asked; its origin."""

    folder: Path
    role: str
    names: tuple[str, ...]
    views: Mapping[int, Mapping[str, Any]]
    origin: Mapping[str, Any]
    asked: Mapping[str, Any]

    @property
    def plan(self) -> CapturePlan:
        """What was asked of each camera. Raises BadInputError where the capture does not tell."""
        if not self.asked:
            raise BadInputError(f"{self.folder} does not say what was asked for. {_WHAT_TO_DO}")
        return CapturePlan(**self.asked)

    @property
    def missing(self) -> tuple[str, ...]:
        """The names of the views that are not there."""
        return tuple(name for number, name in enumerate(self.names) if number not in self.views)


def parts_of(folder: Path, names: Sequence[str]) -> CaptureParts:
    """What a capture holds, whole or not, of views with these names. Raises BadInputError."""
    if (folder / "manifest.json").exists():
        manifest = read_manifest(folder)
        views = {n: view for n, view in enumerate(manifest["views"]) if n < len(names)}
        asked = manifest["views"][0].get("plan", {})
        return CaptureParts(folder, manifest["role"], tuple(names), views, manifest.get("origin", {}), asked)
    about = _read(folder / "incomplete.json") if (folder / "incomplete.json").exists() else {}
    found = {n: _read(_part(folder, n)) for n in range(len(names)) if _part(folder, n).exists()}
    views = {n: part for n, part in found.items() if part.get("view") == names[n]}
    role, origin, asked = about.get("role", ""), about.get("origin", {}), about.get("plan", {})
    return CaptureParts(folder, role, tuple(names), views, origin, asked)


def keep_part(
    folder: Path, burst: Burst, number: int, name: str, about: Mapping[str, Any] | None = None
) -> None:
    """Keep the picture of one view durably; another one of that view is replaced. `about` is kept beside it."""
    path = folder / image_name(burst.plan.role, number)
    _part(folder, number).unlink(missing_ok=True)
    write_image(path, BurstImage(burst.mean, burst.std, burst.frames))
    part = {"file": path.name, "sha256": sha256(path), "view": name}
    write_json(_part(folder, number), part | describe_burst(burst) | dict(about or {}))


def carry_over(parts: CaptureParts, folder: Path, without: int) -> None:
    """Give a new capture the parts of another one, but for one view."""
    for number, view in parts.views.items():
        if number == without:
            continue
        picture = inside(parts.folder, view["file"])
        with reading(picture, _WHAT_TO_DO):
            content = picture.read_bytes()
        (folder / view["file"]).write_bytes(content)
        write_json(_part(folder, number), {**view, "view": parts.names[number]})


def note_origin(folder: Path, plan: CapturePlan, origin: Mapping[str, Any]) -> None:
    """Keep what was asked for, and what the manifest will say of where a capture comes from, until it is whole."""
    about = {"role": plan.role, "plan": to_plain(plan), "origin": dict(origin)}
    write_json(folder / "incomplete.json", about)


def make_whole(parts: CaptureParts) -> bool:
    """Write the manifest if no view is missing; return whether it is written."""
    if parts.missing:
        return False
    views = [parts.views[number] for number in range(len(parts.names))]
    finish(parts.folder, parts.role, views, True, parts.origin)
    for path in parts.folder.glob("part-*.json"):
        path.unlink()
    return True


def _part(folder: Path, number: int) -> Path:
    return folder / f"part-{number}.json"


def _read(path: Path) -> dict[str, Any]:
    with reading(path, _WHAT_TO_DO):
        content = path.read_bytes()
    return parse_manifest(content, path)
