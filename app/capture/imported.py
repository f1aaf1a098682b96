"""Pictures that another camera took become captures, as if they had been taken here.

Of several views each camera's pictures may be brought by themselves, at any time: a capture waits, as a folder
without a manifest, until every view is there.
"""

from collections.abc import Collection, Mapping
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from app.capture.burst import TakenBurst, take
from app.capture.checks import judged
from app.capture.files import FEWER_BITS_COUNTS, PictureFiles, picture_files
from app.capture.watched import UNWATCHED, BurstWatch, run_watched
from app.errors import AirlensError, BadInputError
from app.experiment.capture_parts import parts_of
from app.experiment.folder import Experiment, interrupted, new_id
from app.experiment.recorder import CaptureRecorder
from app.experiment.views import view_names, view_number
from app.files.lock import locked
from app.files.provenance import sha256
from app.rig.conditions import UNTOLD, Conditions, conditions_of, known_pairs
from drivers.burst import BurstOutcome, CapturePlan, CaptureRole
from drivers.verdict import Verdict

ROLES: tuple[CaptureRole, ...] = ("dark", "flat", "reference", "flow")


class TakenBy(NamedTuple):
    """What pictures show: a role, seen by the camera of one view; of one view it need not be named."""

    role: CaptureRole
    view: str | None = None


def import_pictures(
    experiment: Experiment,
    names: Mapping[CaptureRole, list[str]],
    bits: int | None = None,
    told: Conditions = UNTOLD,
    watch: BurstWatch = UNWATCHED,
    view: str | None = None,
) -> list[TakenBurst]:
    """Import the pictures that `names` are: files, folders or patterns. See `import_files`. Raises BadInputError."""
    given = {TakenBy(role, view): picture_files(names[role]) for role in ROLES if names.get(role)}
    return import_files(experiment, given, bits, told, watch)


def import_files(
    experiment: Experiment,
    given: Mapping[TakenBy, list[Path]],
    bits: int | None = None,
    told: Conditions = UNTOLD,
    watch: BurstWatch = UNWATCHED,
    lossy: Collection[TakenBy] = (),
    called: Mapping[Path, str] | None = None,
) -> list[TakenBurst]:
    """One capture for each role that has pictures: mean, scatter and count of each pixel, and verdicts.

    Where some views have none yet the capture waits for them, and `TakenBurst.failed` names them. `bits` are those of
    the counts, by default all that the files have. Their size is held against the view's camera before any capture is
    made. `lossy` are those whose pictures had been compressed before they became these files. `called` says what
    their owner calls files that lie here under other names. Raises BadInputError.
    """
    if not given:
        raise BadInputError(
            "No picture was given. Name the pictures of at least one role: --reference, --flow."
        )
    views = {shown: view_number(experiment, shown.view) for shown in given}
    _check_apart(given, called or {})
    for shown, files in given.items():
        pictures = PictureFiles(files, bits, called)
        _check_size(experiment, pictures, shown.role, views[shown])
        with_it = {views[one] for one in given if one.role == shown.role}
        _check_new(experiment, pictures, shown.role, views[shown], with_it)
    taken: dict[Path | None, TakenBurst] = {}
    for shown, files in sorted(given.items(), key=lambda one: (ROLES.index(one[0].role), views[one[0]])):
        with PictureFiles(files, bits, called) as pictures:
            known = _verdicts(pictures, shown.role, pictures.lossy or shown in lossy)
            one = _brought(experiment, pictures, shown.role, views[shown], known, told, watch)
        taken[one.folder] = one
    return list(taken.values())


def _brought(
    experiment: Experiment,
    pictures: PictureFiles,
    role: CaptureRole,
    view: int,
    known: tuple[Verdict, ...],
    told: Conditions,
    watch: BurstWatch,
) -> TakenBurst:
    """One view's pictures in a capture of their own, or in the one that waits for them."""
    plan, names = CapturePlan(role, pictures.frames, settle_frames=0, max_refused=0), view_names(experiment)
    if len(names) == 1:
        one = take(pictures, experiment, plan, told, watch, source=pictures.origin, known=known)
        if one.shortfall:
            raise AirlensError(one.shortfall)
        return one
    burst = run_watched(pictures, plan, watch, lambda taken: None, None)
    if burst.outcome is not BurstOutcome.COMPLETE:
        raise AirlensError(
            f"Only {burst.frames} of {plan.frames} {role} pictures of {names[view]!r} can be read."
        )
    burst = judged(experiment, replace(burst, verdicts=(*burst.verdicts, *known)), told, view)
    origin = {"rig": "imported"} | known_pairs(conditions_of(experiment.settings, told))
    files = {"files": pictures.origin["files"]}
    with locked(experiment.folder):
        folder = _waiting(experiment, role)
        if folder is None:
            folder = experiment.captures_folder / new_id(experiment.captures_folder, role)
        recorder = CaptureRecorder(folder, plan)
        try:
            missing = recorder.keep_views({view: burst}, names, origin, files)
        except BaseException:
            recorder.leave()
            raise
    return TakenBurst(burst, folder, dict.fromkeys(missing, "its pictures were not imported yet"))


def _waiting(experiment: Experiment, role: CaptureRole) -> Path | None:
    """The newest imported capture of a role that waits for a view."""
    names = view_names(experiment)
    for folder in reversed(interrupted(experiment.captures_folder)):
        parts = parts_of(folder, names)
        if parts.views and parts.role == role and parts.origin.get("rig") == "imported":
            return folder
    return None


def _check_apart(given: Mapping[TakenBy, list[Path]], called: Mapping[Path, str]) -> None:
    """Raise BadInputError for a picture that is named twice, or is in two views' files."""
    seen: dict[object, TakenBy] = {}
    several = len({shown.view for shown in given}) > 1
    for shown, files in given.items():
        for file in files:
            content = [(shown.role, sha256(file))] if several else []
            for known in (file.resolve(), *content):
                other = seen.setdefault(known, shown)
                if other != shown:
                    raise BadInputError(
                        f"{called.get(file, file)} is named as {_said(other)} and as {_said(shown)}. Keep the "
                        "pictures of each in a folder of their own."
                    )


def _said(shown: TakenBy) -> str:
    return shown.role if shown.view is None else f"{shown.role} of {shown.view!r}"


def _check_new(
    experiment: Experiment, pictures: PictureFiles, role: CaptureRole, view: int, with_it: Collection[int]
) -> None:
    """Raise BadInputError for a picture that the waiting capture has as another view's, and keeps.

    `with_it` are the views whose pictures of that role are given now.
    """
    folder, names = _waiting(experiment, role), view_names(experiment)
    if folder is None:
        return
    own = {file["sha256"]: file["name"] for file in pictures.origin["files"]}
    for number, part in parts_of(folder, names).views.items():
        twice = own.keys() & {file["sha256"] for file in part.get("files", ())}
        if number not in with_it and twice:
            raise BadInputError(
                f"{own[min(twice)]} was imported as the {role} of {names[number]!r} already. Give the pictures of "
                f"{names[view]!r}, or import those of {names[number]!r} again: they then replace the wrong ones."
            )


def _check_size(experiment: Experiment, pictures: PictureFiles, role: str, view: int) -> None:
    """Raise BadInputError where the pictures are not the view's camera's."""
    info, eye = pictures.info, experiment.settings.scene.views[view]
    if (info.width_px, info.height_px) != (eye.camera.width_px, eye.camera.height_px):
        raise BadInputError(
            f"The {role} pictures have {info.width_px} x {info.height_px} px; the camera {eye.name!r} of "
            f"{experiment.folder.name} has {eye.camera.width_px} x {eye.camera.height_px} px. State the size in the "
            "experiment (width_px, height_px), or import the pictures as the camera gave them, not cropped and not "
            "scaled."
        )


def _verdicts(pictures: PictureFiles, role: CaptureRole, lossy: bool) -> tuple[Verdict, ...]:
    """What the files themselves say of the pictures."""
    found = []
    if role != "dark" and pictures.may_have_fewer_bits:
        found.append(
            Verdict(
                "bits", False, float(pictures.highest_counts), f"counts above {FEWER_BITS_COUNTS} in 16-bit files",
                "A camera of 10, 12 or 14 bits may have taken them. If so, state its bits (bits, --bits): a longer "
                "exposure, as a low level else asks for, would saturate it.",
            )
        )  # fmt: skip
    if lossy:
        found.append(
            Verdict(
                "compression", False, 1.0, "pictures without loss (TIFF, PNG, raw)",
                "JPEG changes fine texture differently in each picture, which looks like noise of the shift. Export "
                "TIFF or PNG from the camera's raw files.",
            )
        )  # fmt: skip
    if pictures.frames < 2:
        found.append(
            Verdict(
                "frames", False, float(pictures.frames), "at least 2 pictures",
                "From one picture nobody can tell its noise: the scene's camera noise is taken. Give 10 or more.",
            )
        )  # fmt: skip
    return tuple(found)
