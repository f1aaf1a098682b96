"""Calibration steps on pictures: each reads what it can use, names what it cannot, and keeps the rest.

boards -> camera        sequences -> projector        wall sequence or board on the wall -> wall
"""

import functools
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np

from app.calibrate.folder import CalibrationFolder, StepName
from app.calibrate.whose import check_own
from app.errors import BadInputError
from app.files.image_folder import Sequence, find_images, read_grey, sequences
from calibration.board import Board, fixes_pose
from calibration.bundle import CalibratedOptics
from calibration.errors import CalibrationError, TooFewViewsError
from calibration.further_projector import FurtherProjector, build_projector
from calibration.graycode import decode, frame_count
from calibration.local import on_panel
from calibration.model import Model, build
from calibration.record import Placement, Record, SeenBoard, SeenWall, rows_of, seen_board
from calibration.sequence import resampling_issue, sequence_issues
from calibration.stripes import stripe_edges
from calibration.views import digest, view_of
from calibration.wall import correspondences

# Sequences of at least this many frames in one folder are Gray code, not views of a board.
GRAY_CODE_FRAMES = 10
OnEvent = Callable[[str], None]


@dataclass(frozen=True)
class StepOutcome:
    """What a step came to: the models so far (none: not enough yet), everything to retake, and what is missing.

    `missing` says that more pictures are wanted; those that were taken are not at fault.
    """

    name: StepName
    model: Model | FurtherProjector | None
    record: Record
    issues: tuple[str, ...]
    missing: str = ""


@dataclass(frozen=True)
class Pictures:
    """Where pictures come from and what is known of them."""

    folder: Path
    pattern: str | None = None
    full_scale: int | None = None
    white_first: bool = False


def calibrate_camera(
    calibration: CalibrationFolder, camera: str, pictures: Pictures, board: Board, on_event: OnEvent
) -> StepOutcome:
    """Find the board in every picture (of a Gray-code sequence: in white) and fit the camera."""
    check_own(calibration, camera, StepName.camera)
    files = find_images(pictures.folder, pictures.pattern)
    boards, issues = [], []
    for file in _board_files(pictures, files):
        name = file.relative_to(pictures.folder).as_posix()
        on_event(name)
        try:
            image = read_grey(file)
            view = view_of(name, image, board, pictures.full_scale)
        except (BadInputError, CalibrationError) as error:
            issues.append(str(error))
            continue
        issues += view.issues
        if view.usable:
            boards.append(((view.width_px, view.height_px), seen_board(view, digest(image))))
    return _added(calibration, StepName.camera, camera, boards, issues)


def calibrate_projector(
    calibration: CalibrationFolder,
    camera: str,
    pictures: Pictures,
    board: Board,
    panel_px: tuple[int, int],
    on_event: OnEvent,
) -> StepOutcome:
    """Decode every sequence, carry the board's corners to the panel, and fit camera and projector.

    Of a view that another one's camera takes the projector alone is fitted: that camera stands as it is.
    """
    check_own(calibration, camera, StepName.projector)
    files = find_images(pictures.folder, pictures.pattern)
    boards, issues = [], []
    for sequence in sequences(pictures.folder, files):
        on_event(sequence.name)
        try:
            frames = _frames(sequence, pictures, panel_px)
            size, seen, found = _lit_board(sequence.name, frames, board, panel_px, pictures.full_scale)
        except (BadInputError, CalibrationError) as error:
            issues.append(str(error))
            continue
        issues += found
        if seen is not None:
            boards.append((size, seen))
    return _added(calibration, StepName.projector, camera, boards, issues, panel_px)


def calibrate_wall(
    calibration: CalibrationFolder,
    camera: str,
    wall: Pictures | None,
    level: tuple[Path, Board] | None,
    placement: Placement,
    on_event: OnEvent,
) -> StepOutcome:
    """The wall from Gray code on it, or from a board held flat against it; the world's axes and origin."""
    check_own(calibration, camera, StepName.wall)
    record = calibration.collected(camera)
    if record is None:
        raise BadInputError("There is no calibrated camera yet; run 'airlens calibrate camera' first.")
    record, issues = replace(record, placement=placement), []
    if level is not None:
        image = read_grey(level[0])
        view = view_of(level[0].name, image, level[1])
        issues += view.issues
        if view.usable:
            record = replace(record, level=seen_board(view, digest(image)))
    if wall is not None:
        if record.panel_size_px is None:
            raise BadInputError(
                "Gray code on the wall needs a calibrated projector; run 'airlens calibrate projector' "
                "first, or give --level-image, a picture of a board held flat against the wall."
            )
        found = sequences(wall.folder, find_images(wall.folder, wall.pattern))
        if len(found) != 1:
            names = ", ".join(s.name for s in found)
            raise BadInputError(f"{wall.folder} holds {len(found)} sequences ({names}); expected one.")
        on_event(found[0].name)
        frames = _frames(found[0], wall, record.panel_size_px)
        record = replace(record, wall=_seen_wall(found[0].name, frames, record.panel_size_px, wall))
    if record.wall is None and record.level is None:
        raise BadInputError(
            "Nothing shows the wall; give --images, a Gray-code sequence on it, or --level-image."
        )
    return built(calibration, StepName.wall, record, issues)


def _added(
    calibration: CalibrationFolder,
    step: StepName,
    camera: str,
    boards: list[tuple[tuple[int, int], SeenBoard]],
    issues: list[str],
    panel_px: tuple[int, int] | None = None,
) -> StepOutcome:
    """Add the boards to the record and build; pictures of another size and repeated ones are named."""
    old = calibration.collected(camera)
    if not boards and old is None:
        raise BadInputError("No picture shows the board. " + " ".join(issues[:5]))
    size = old.camera_size_px if old else Counter(s for s, _ in boards).most_common(1)[0][0]
    kept: dict[str, SeenBoard] = {}
    for own, board in boards:
        if own != size:
            issues.append(
                f"{board.name} is {own[0]} x {own[1]} px, the others {size[0]} x {size[1]}; "
                "retake it in the same camera mode. It was left out."
            )
        elif board.sha256 in kept:
            issues.append(f"{board.name} is the same picture as {kept[board.sha256].name}; retake it.")
        else:
            kept[board.sha256] = board
    record = old or Record(camera, size)
    record = _merged(record, tuple(kept.values()), panel_px)
    return built(calibration, step, record, issues)


def _merged(record: Record, boards: tuple[SeenBoard, ...], panel_px: tuple[int, int] | None) -> Record:
    """Newly lit boards replace the same pictures seen without the projector, never the reverse."""
    lit = {b.sha256 for b in record.boards if b.panel_px}
    boards = tuple(b for b in boards if b.panel_px or b.sha256 not in lit)
    return replace(record.with_boards(boards), panel_size_px=panel_px or record.panel_size_px)


@functools.lru_cache(maxsize=2)
def model_of(record: Record) -> Model:
    """The models of a record; the newest ones are remembered. Raises CalibrationError."""
    with _solvable():
        return build(record)


@functools.lru_cache(maxsize=2)
def _projector_of(record: Record, camera: CalibratedOptics) -> FurtherProjector:
    with _solvable():
        return build_projector(record, camera)


@contextmanager
def _solvable() -> Iterator[None]:
    """Raise CalibrationError where what was seen does not determine the models, so that no solver finds them."""
    try:
        yield
    except (np.linalg.LinAlgError, cv2.error) as error:
        raise CalibrationError(
            "No models follow from the views of the board: the equations have no solution. Retake the newest views, "
            "with the board whole, elsewhere and tilted in each."
        ) from error


def own_model(calibration: CalibrationFolder, record: Record) -> Model | FurtherProjector:
    """All models of a record; of a view that another one's camera takes the projector. Raises CalibrationError."""
    owner = calibration.owner(record.camera)
    return model_of(record) if owner is None else _projector_of(record, calibration.bundle().camera(owner))


def built(calibration: CalibrationFolder, step: StepName, record: Record, issues: list[str]) -> StepOutcome:
    """Keep the record as that of a started step, and make its models as far as it allows."""
    calibration.save_started(step, record)
    return modelled(calibration, step, record, issues)


def modelled(
    calibration: CalibrationFolder, step: StepName, record: Record, issues: list[str]
) -> StepOutcome:
    """A step's models as far as its record allows; too few views yet are no issue."""
    try:
        model = own_model(calibration, record)
    except TooFewViewsError as error:
        return StepOutcome(step, None, record, tuple(issues), str(error))
    except CalibrationError as error:
        return StepOutcome(step, None, record, (*issues, str(error)))
    missing = ""
    if isinstance(model, Model) and record.panel_size_px is not None and model.pair is None:
        lit = sum(bool(b.panel_px) for b in record.boards)
        missing = f"{lit} boards carry usable Gray code; expected at least 3. Take more sequences."
    return StepOutcome(step, model, record, tuple(issues), missing)


def put_to_use(calibration: CalibrationFolder, step: StepOutcome) -> StepOutcome:
    """Make a step's models those in use, if there are any."""
    if step.model is not None:
        calibration.put_to_use(step.model)
    return step


def _board_files(pictures: Pictures, files: list[Path]) -> list[Path]:
    """Every picture is a view, except that a long sequence in a subfolder counts once, by its white."""
    chosen = []
    for sequence in sequences(pictures.folder, files):
        nested = sequence.files[0].parent != pictures.folder
        if nested and len(sequence.files) >= GRAY_CODE_FRAMES:
            chosen.append(sequence.files[0 if pictures.white_first else -2])
        else:
            chosen += sequence.files
    return chosen


def _frames(sequence: Sequence, pictures: Pictures, panel_px: tuple[int, int]) -> np.ndarray:
    """The frames in order, white and black last. Raises BadInputError naming what is missing."""
    expected = frame_count(*panel_px)
    if sequence.missing or len(sequence.files) != expected:
        missing = ", ".join(map(str, sequence.missing)) or "none between its first and last"
        raise BadInputError(
            f"{sequence.name} has {len(sequence.files)} frames (missing: {missing}); a projector of "
            f"{panel_px[0]} x {panel_px[1]} px needs {expected}. Retake this sequence; it was left out."
        )
    images = [read_grey(file) for file in sequence.files]
    sizes = Counter(image.shape for image in images)
    if len(sizes) != 1:
        common = sizes.most_common(1)[0][0]
        odd = [f.name for f, i in zip(sequence.files, images, strict=True) if i.shape != common]
        raise BadInputError(
            f"{sequence.name}: {', '.join(odd[:3])} differ in size from the other frames. "
            "Retake this sequence in one camera mode; it was left out."
        )
    if pictures.white_first:
        images = images[2:] + images[:2]
    return np.stack(images)


def _lit_board(
    name: str, frames: np.ndarray, board: Board, panel_px: tuple[int, int], full_scale: int | None
) -> tuple[tuple[int, int], SeenBoard | None, list[str]]:
    """The board in white, its corners on the panel, and what is wrong with the sequence."""
    view = view_of(name, frames[-2], board, full_scale)
    size = (view.width_px, view.height_px)
    decoded = decode(frames, *panel_px)
    issues = [*view.issues, *sequence_issues(name, frames, decoded, full_scale)]
    if view.detection is None:
        return size, None, issues
    edges = stripe_edges(frames, decoded, *panel_px)
    corners = view.detection.pixels_px
    spread = np.linalg.norm(corners[:, None] - corners[None], axis=2)
    np.fill_diagonal(spread, np.inf)
    half_px = int(np.clip(0.35 * np.median(spread.min(axis=0)), 8, 24))
    places, good, rms = on_panel(decoded, edges, corners, half_px)
    uneven = resampling_issue(name, frames, decoded, edges, float(np.median(rms)))
    if uneven:
        issues.append(uneven)
    if good.sum() < 0.5 * len(good):
        issues.append(
            f"{name}: Gray code decodes at {good.sum()} of {len(good)} corners. Retake it: light the whole "
            "board, keep it still, keep the frames in order."
        )
    seen = seen_board(view, digest(frames[-2]))
    if good.sum() >= 6 and fixes_pose(view.points_m[good]):
        seen = replace(seen, panel_points_m=rows_of(view.points_m[good]), panel_px=rows_of(places[good]))
    return size, seen, issues


def _seen_wall(name: str, frames: np.ndarray, panel_px: tuple[int, int], wall: Pictures) -> SeenWall:
    decoded = decode(frames, *panel_px)
    issues = list(sequence_issues(name, frames, decoded, wall.full_scale))
    edges = stripe_edges(frames, decoded, *panel_px)
    step_px = max(frames.shape[2] // 50, 12)
    try:
        seen = correspondences(decoded, edges, step_px)
    except CalibrationError as error:
        raise BadInputError(" ".join([str(error), *issues])) from error
    return SeenWall(
        name, digest(frames[-2]), rows_of(seen.camera_px), rows_of(seen.projector_px), tuple(issues)
    )
