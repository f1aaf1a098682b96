"""Pictures that another camera took become captures, as if they had been taken here."""

from collections.abc import Collection, Mapping
from pathlib import Path

from app.capture.burst import BurstWatch, TakenBurst, take
from app.capture.files import PictureFiles, picture_files
from app.errors import AirlensError, BadInputError
from app.experiment.folder import Experiment
from app.rig.conditions import UNTOLD, Conditions
from drivers.burst import CapturePlan, CaptureRole
from drivers.verdict import Verdict

ROLES: tuple[CaptureRole, ...] = ("dark", "flat", "reference", "flow")
_UNWATCHED = BurstWatch()


def import_pictures(
    experiment: Experiment,
    names: Mapping[CaptureRole, list[str]],
    bits: int | None = None,
    told: Conditions = UNTOLD,
    watch: BurstWatch = _UNWATCHED,
) -> list[TakenBurst]:
    """Import the pictures that `names` are: files, folders or patterns. See `import_files`. Raises BadInputError."""
    given: dict[CaptureRole, list[Path]] = {
        role: picture_files(names[role]) for role in ROLES if names.get(role)
    }
    return import_files(experiment, given, bits, told, watch)


def import_files(
    experiment: Experiment,
    given: Mapping[CaptureRole, list[Path]],
    bits: int | None = None,
    told: Conditions = UNTOLD,
    watch: BurstWatch = _UNWATCHED,
    lossy: Collection[CaptureRole] = (),
) -> list[TakenBurst]:
    """One capture for each role that has pictures: mean, scatter and count of each pixel, and verdicts.

    `bits` are those of the counts, by default all that the files have. Their size is held against the scene's
    camera before any capture is made. `lossy` are roles whose pictures had been compressed before they became
    these files. Raises BadInputError.
    """
    if not given:
        raise BadInputError(
            "No picture was given. Name the pictures of at least one role: --reference, --flow."
        )
    _check_apart(given)
    for role, files in given.items():
        _check_size(experiment, PictureFiles(files, bits), role)
    taken = []
    for role, files in given.items():
        with PictureFiles(files, bits) as pictures:
            plan = CapturePlan(role, pictures.frames, settle_frames=0, max_refused=0)
            known = _verdicts(pictures, pictures.lossy or role in lossy)
            one = take(pictures, experiment, plan, told, watch, source=pictures.origin, known=known)
        if one.shortfall:
            raise AirlensError(one.shortfall)
        taken.append(one)
    return taken


def _check_apart(given: Mapping[CaptureRole, list[Path]]) -> None:
    """Raise BadInputError for a picture that is named for two roles."""
    roles: dict[Path, str] = {}
    for role, files in given.items():
        for file in files:
            other = roles.setdefault(file.resolve(), role)
            if other != role:
                raise BadInputError(
                    f"{file} is named as {other} and as {role}. Keep the pictures of each in a folder of their own."
                )


def _check_size(experiment: Experiment, pictures: PictureFiles, role: str) -> None:
    """Raise BadInputError where the pictures are not the scene's camera's."""
    info, camera = pictures.info, experiment.settings.scene.views[0].camera
    if (info.width_px, info.height_px) != (camera.width_px, camera.height_px):
        raise BadInputError(
            f"The {role} pictures have {info.width_px} x {info.height_px} px; the camera of {experiment.folder.name} "
            f"has {camera.width_px} x {camera.height_px} px. State the size in the experiment (width_px, height_px), "
            "or import the pictures as the camera gave them, not cropped and not scaled."
        )


def _verdicts(pictures: PictureFiles, lossy: bool) -> tuple[Verdict, ...]:
    """What the files themselves say of the pictures."""
    found = []
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
