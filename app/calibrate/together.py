"""Several views adjusted together: which of them were calibrated, what they share, and what comes of it.

Pictures of one board by several cameras at once lie in one folder a camera, called by its name; pictures of the same
file name were taken at the same time.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from app.calibrate.folder import CalibrationFolder, in_a_name
from app.calibrate.steps import model_of
from app.errors import BadInputError
from app.experiment.folder import open_experiment
from app.experiment.views import own_cameras, view_names
from app.files.image_folder import find_images, read_grey
from calibration.board import Board
from calibration.bundle import CalibratedOptics, Joint
from calibration.errors import CalibrationError
from calibration.record import Record, SeenBoard, seen_board
from calibration.shared import SharedBoard
from calibration.tie import NothingSharedError, Seat, groups
from calibration.together import Stated, Together, adjust_together
from calibration.views import digest, view_of
from calibration.world import difference
from core.scene import ProjectedPattern

OnEvent = Callable[[str], None]


@dataclass(frozen=True)
class TogetherOutcome:
    """What came of it; `moved_m` is how far each camera moved by it, by its name."""

    together: Together
    moved_m: dict[str, float]
    issues: tuple[str, ...]


def together(calibration: CalibrationFolder, stated: Stated, issues: tuple[str, ...] = ()) -> TogetherOutcome:
    """Adjust the calibrated views of an experiment together, and put that to use.

    Raises BadInputError where fewer than two views are calibrated from pictures, or nothing is shared.
    """
    seats, without = seats_of(calibration)
    shared = calibration.shared().boards
    tied, *others = groups(seats, shared)
    if len(tied) < 2:
        raise BadInputError(_nothing_shared(seats))
    apart = tuple(seat.camera for group in others for seat in group)
    told = [f"{name!r} has no camera calibrated from pictures; it stays as it is." for name in without]
    told += [f"{name!r} shares nothing with the others; it stays as it is." for name in apart]
    before = calibration.bundle()
    try:
        found = adjust_together(tied, shared, stated)
    except NothingSharedError as error:
        raise BadInputError(f"{error} {' '.join(issues)}".strip()) from error
    except CalibrationError as error:
        raise BadInputError(str(error)) from error
    told += [
        f"{name}: the board moved between the pictures of its cameras. It was left out; retake it."
        for name in found.tied.moved
    ]
    calibration.put_together(found)
    moved = {
        name: float(np.linalg.norm(difference(view.camera.optics, before.camera(name).optics)[12:]))
        for name, view in found.views.items()
    }
    return TogetherOutcome(found, moved, (*issues, *told, *found.contradictions))


def seats_of(calibration: CalibrationFolder) -> tuple[tuple[Seat, ...], tuple[str, ...]]:
    """The views that were calibrated from pictures, and the names of the others. Raises BadInputError.

    Views lit by a projector that is stated at the same place have the same projector.
    """
    scene = open_experiment(calibration.experiment).settings.scene
    records, without = records_of(calibration)
    seats = []
    for view in scene.views:
        record, light = records.get(view.name), view.light or scene.light
        if record is None:
            continue
        lamp = repr(light.projector) if isinstance(light, ProjectedPattern) else ""
        try:
            seats.append(Seat(model_of(record), lamp))
        except CalibrationError as error:
            raise BadInputError(f"{view.name!r}: {error}") from error
    return tuple(seats), without


def records_of(calibration: CalibrationFolder) -> tuple[dict[str, Record], tuple[str, ...]]:
    """What the calibrated cameras saw, by their views, and the names of the views that have no calibrated camera.

    Raises BadInputError where fewer than two are calibrated from pictures.
    """
    experiment = open_experiment(calibration.experiment)
    names = [view_names(experiment)[number] for number in own_cameras(experiment)]
    if len(names) < 2:
        raise BadInputError(
            "This experiment has one camera; expected two or more. State a further one under [[view]]."
        )
    found = {name: calibration.record(name) for name in names}
    records = {name: record for name, record in found.items() if record is not None}
    without = tuple(name for name in names if name not in records)
    if len(records) < 2:
        named = ", ".join(map(repr, without))
        raise BadInputError(
            f"{named} {'has' if len(without) == 1 else 'have'} no camera calibrated from pictures; expected two "
            "views that have. Take the steps camera, then wall, of each (airlens calibrate, with --view NAME)."
        )
    return records, without


@dataclass(frozen=True)
class Added:
    """What pictures of several cameras showed: the boards by their place and camera, and what is wrong."""

    seen: dict[str, dict[str, SeenBoard]]
    issues: tuple[str, ...]


def add_pictures(
    calibration: CalibrationFolder,
    folder: Path,
    board: Board,
    full_scale: int | None,
    say: OnEvent,
    pattern: str = "*",
) -> Added:
    """Look for the board in pictures of several cameras, and keep the places that two or more saw.

    Raises BadInputError where no two cameras have a folder of pictures.
    """
    experiment = open_experiment(calibration.experiment)
    names = [view_names(experiment)[number] for number in own_cameras(experiment)]
    folders = {name: folder / in_a_name(name) for name in names if (folder / in_a_name(name)).is_dir()}
    if len(folders) < 2:
        raise BadInputError(
            f"{folder} holds {len(folders)} of the folders {', '.join(map(in_a_name, names))}; expected one for each "
            "camera, called by its name. Pictures of the same file name in them were taken at the same time."
        )
    seen: dict[str, dict[str, SeenBoard]] = {}
    issues: list[str] = []
    for name, own in folders.items():
        if pattern != "*" and not any(own.glob(pattern)):
            continue  # a camera that failed has told so
        for file in find_images(own, pattern):
            told = f"{in_a_name(name)}/{file.name}"
            say(told)
            try:
                image = read_grey(file)
                view = view_of(told, image, board, full_scale)
            except (BadInputError, CalibrationError) as error:
                issues.append(str(error))
                continue
            record = calibration.record(name)
            if record is not None and record.camera_size_px != (view.width_px, view.height_px):
                issues.append(
                    f"{told} is {view.width_px} x {view.height_px} px, those of the calibration "
                    f"{record.camera_size_px[0]} x {record.camera_size_px[1]}. Retake it in the same camera mode."
                )
                continue
            issues += view.issues
            if view.usable:
                seen.setdefault(file.stem, {})[name] = seen_board(view, digest(image))
    boards = tuple(SharedBoard(place, both) for place, both in seen.items() if len(both) > 1)
    calibration.change_shared(lambda record: record.with_boards(boards))
    alone = [f"{place} by {next(iter(both))!r}" for place, both in seen.items() if len(both) == 1]
    if alone:
        issues.append(f"Seen by one camera only, so of no use here: {', '.join(alone)}.")
    return Added(seen, tuple(issues))


def summary(outcome: TogetherOutcome) -> dict[str, Any]:
    """The outcome as JSON values."""
    found = outcome.together
    return {
        "views": {
            name: {
                "position_m": list(view.camera.optics.position_m),
                "position_std_m": np.sqrt(np.diag(view.camera.covariance_matrix()))[12:].tolist(),
                "moved_m": outcome.moved_m[name],
            }
            for name, view in found.views.items()
        },
        "pairs": pairs_of(found.joint, {name: view.camera for name, view in found.views.items()}),
        "boards": found.joint.boards,
        "rms_px": found.joint.rms_px,
        "issues": list(outcome.issues),
    }


def pairs_of(joint: Joint, cameras: dict[str, CalibratedOptics]) -> list[dict[str, Any]]:
    """How every two of the cameras stand to one another, as JSON values."""
    names = list(cameras)
    pairs = [(a, b) for n, a in enumerate(names) for b in names[n + 1 :]]
    return [relative(joint, cameras[a], cameras[b]) | {"views": [a, b]} for a, b in pairs]


def lines(content: dict[str, Any]) -> list[str]:
    """The summary as sentences for a person."""
    shared = (
        f"{content['boards']} boards seen by several cameras, rms {content['rms_px']:.3f} px"
        if content["boards"]
        else "tied by a projector that lit the boards of both"
    )
    text = [f"together: {shared}"]
    for pair in content["pairs"]:
        a, b = pair["views"]
        text.append(
            f"{a} and {b}: {pair['apart_m']:.4f} ± {pair['apart_std_m']:.4f} m apart, turned by "
            f"{pair['turned_deg']:.3f} ± {pair['turned_std_deg']:.3f} degrees"
        )
    text += [f"{name} moved by {1e3 * view['moved_m']:.1f} mm" for name, view in content["views"].items()]
    return text + [f"- {issue}" for issue in content["issues"]]


def relative(joint: Joint, one: CalibratedOptics, other: CalibratedOptics) -> dict[str, float]:
    """How far apart two cameras stand and how they are turned, each with its standard deviation.

    The deviation of the turn is that about the axis in which it is largest.
    """
    covariance = joint.covariance_of(one.name, other.name)
    apart_m = np.subtract(other.optics.position_m, one.optics.position_m)
    length_m = float(np.linalg.norm(apart_m))
    along = np.concatenate([np.zeros(12), -apart_m, np.zeros(12), apart_m]) / max(length_m, 1e-12)
    turn = other.optics.rotation @ one.optics.rotation.T
    by = np.zeros((3, 30))
    by[:, 9:12], by[:, 24:27] = -turn, np.eye(3)
    angle = math.acos(max(-1.0, min(1.0, (float(np.trace(turn)) - 1) / 2)))
    return {
        "apart_m": length_m,
        "apart_std_m": float(np.sqrt(along @ covariance @ along)),
        "turned_deg": math.degrees(angle),
        "turned_std_deg": math.degrees(float(np.sqrt(np.linalg.eigvalsh(by @ covariance @ by.T)[-1]))),
    }


def _nothing_shared(seats: tuple[Seat, ...]) -> str:
    named = " and ".join(repr(seat.camera) for seat in seats)
    return (
        f"Nothing that more than one sees ties {named}: no board was pictured by two of them at the same time, and "
        "no projector lit the boards of two. Run airlens calibrate together without --images and show the board "
        "where two cameras see it whole, or give --images with one folder a camera."
    )
