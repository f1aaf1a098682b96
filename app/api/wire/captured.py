"""A capture's folder as a resource: what each camera took, how good it is, and what is missing."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Literal

from app.api.folders import shown_name
from app.api.models.captures import CaptureResource, SettingResource, VerdictResource, ViewPicture
from app.capture.retake import may_retake
from app.errors import BadInputError
from app.experiment.capture_parts import parts_of
from app.experiment.folder import read_manifest, revision_of
from app.files.reading import reading

NOTES = "notes.txt"


def capture_line(folder: Path, names: Sequence[str]) -> CaptureResource:
    """A line of the list, whatever the folder holds; `names` are those of the scene's views."""
    try:
        if (folder / "manifest.json").exists():
            return capture_resource(folder, names)
        return _interrupted(folder, names)
    except BadInputError as error:
        return _bare(folder, "broken", reason=str(error))


def capture_resource(folder: Path, names: Sequence[str]) -> CaptureResource:
    """A finished capture. Raises BadInputError for a manifest that is none."""
    manifest = read_manifest(folder)
    with reading(folder / "manifest.json", "Discard the capture, or restore it from a copy."):
        return _shown(folder, manifest, names)


def _shown(folder: Path, manifest: dict[str, Any], names: Sequence[str]) -> CaptureResource:
    views = [_picture(view, _name(view, number, names)) for number, view in enumerate(manifest["views"])]
    first = views[0]
    return CaptureResource(
        capture=folder.name,
        state="finished" if manifest.get("complete", True) else "incomplete",
        role=manifest["role"],
        created=manifest.get("created"),
        frames=first.frames,
        width_px=first.width_px,
        height_px=first.height_px,
        verdicts=first.verdicts,
        settings=first.settings,
        notes=_notes(folder),
        revision=revision_of(_notes(folder).encode()),
        sequence=manifest.get("origin", {}).get("sequence", {}).get("id"),
        views=views,
        missing=[],
        retakes=may_retake(parts_of(folder, names)),
    )


def _picture(view: Mapping[str, Any], name: str) -> ViewPicture:
    camera = view.get("camera", {})
    return ViewPicture(
        view=name,
        frames=view.get("frames"),
        width_px=camera.get("width_px"),
        height_px=camera.get("height_px"),
        verdicts=[VerdictResource(**_float(one, "value")) for one in view.get("verdicts", [])],
        settings=[SettingResource(**_float(one, "granted")) for one in view.get("settings", [])],
    )


def _name(view: Mapping[str, Any], number: int, names: Sequence[str]) -> str:
    """The view's name as it was kept, else as the scene has it now."""
    return view.get("view") or (names[number] if number < len(names) else f"view {number + 1}")


def _float(content: dict[str, Any], name: str) -> dict[str, Any]:
    """JSON writes 1.0 as 1 or 1.0 as its writer likes; ours is a float."""
    return content if content[name] is None else {**content, name: float(content[name])}


def _interrupted(folder: Path, names: Sequence[str]) -> CaptureResource:
    """A capture without a manifest; of several views those that are there, and the names of those that are not."""
    parts = parts_of(folder, names)
    if not parts.views:
        return _bare(folder, "interrupted")
    with reading(folder, "Discard the capture, or restore it from a copy."):
        views = [_picture(view, names[number]) for number, view in sorted(parts.views.items())]
    bare = _bare(folder, "interrupted", parts.role or None)
    return bare.model_copy(
        update={"views": views, "missing": list(parts.missing), "retakes": may_retake(parts)}
    )


def _bare(
    folder: Path, state: Literal["interrupted", "broken"], role: str | None = None, reason: str = ""
) -> CaptureResource:
    return CaptureResource(
        capture=shown_name(folder),
        state=state,
        role=role,
        created=None,
        frames=None,
        width_px=None,
        height_px=None,
        verdicts=[],
        settings=[],
        notes=_notes(folder),
        revision=revision_of(_notes(folder).encode()),
        views=[],
        missing=[],
        reason=reason,
    )


def _notes(folder: Path) -> str:
    path = folder / NOTES
    return path.read_bytes().decode("utf-8", "replace") if path.is_file() else ""
