"""From captures to shifts with their noise, the drift between the exposures taken out."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float32
from scipy.ndimage import uniform_filter

from app.errors import BadInputError
from app.experiment.captures import Capture, CapturePair
from app.experiment.found import Found
from app.reconstruct.bursts import burst_shifts, windows_among
from app.reconstruct.cover import reached_from
from app.reconstruct.drift import Agreement, agreement, mount, without_known_drift
from app.reconstruct.found import Standing, what_stands
from app.reconstruct.pair import check_pair
from app.reconstruct.short_mean import with_short_mean
from app.reconstruct.unstated import past_objects
from app.reconstruct.yardstick import Exposures, Yardstick
from core.camera_noise import frame_variance, scattered_variance
from core.defects import without_defects
from core.displacement import resolve_window_px, window_centres
from core.drift import Motion, move_image
from core.problem import ImagePair, ShiftMeasurement
from core.rays.visibility import hidden_by_objects, sees_wall, within_marks
from core.scene import Scene, View
from core.watch import Watch
from core.window_fit import derivative_filter

Image = Float32[np.ndarray, "rows cols"]
Mask = Bool[np.ndarray, " windows"]


@dataclass(frozen=True)
class Measurement:
    """What two captures say: the shift of every view, with the captures it was measured on.

    `bursts` tell, for each burst of a sequence and each view, how the pattern moved from the mean of all; there are
    none of a single burst. `images` are what a data term of single pixels compares: the reference, moved by the
    drift, and the flow. They are there only where the scene asks for such a term. `notes` tell how the drift was
    found. `found` is what stands before the wall and is not stated; `scene` is the stated one with those of it whose
    place is seen.
    """

    captures: CapturePair
    shifts: tuple[ShiftMeasurement, ...]
    drifts_px: tuple[Motion, ...]
    notes: tuple[str, ...]
    scene: Scene
    images: tuple[ImagePair, ...] = ()
    bursts: tuple[tuple[ShiftMeasurement, ...], ...] = ()
    found: tuple[Found, ...] = ()


def measure(
    captures: CapturePair, scene: Scene, watch: Watch = Watch(), standing: Standing | None = None
) -> Measurement:
    """Measure every view of a reference and a flow. Raises BadInputError, SettingError, StoppedError.

    What is measured of the bursts of a sequence is kept in `watch.store`, and taken from there. `standing` is what
    the reference shows beside the stated, where that was looked for before.
    """
    reference, flow = captures.reference, captures.flow
    _check_captures(reference, flow, scene)
    standing = standing or what_stands(scene, [image.mean for image in reference.images])
    shifts, drifts_px, notes, views = [], [], [], []
    for index, view in enumerate(scene.views):
        shift, drift_px, note = _measure_view(scene, index, view, captures, standing.covered[index])
        alone = _alone(scene, index, _picture(flow, index), shift.window_px)
        shift, bursts, left_out = burst_shifts(scene, index, captures, shift, alone, watch)
        shift, averaged = with_short_mean(shift, bursts, captures)
        views.append(bursts)
        shifts.append(shift)
        drifts_px.append(drift_px)
        whose = f"View {view.name!r}: " if len(scene.views) > 1 else ""
        notes.append(whose + note + left_out + averaged)
    images: tuple[ImagePair, ...] = ()
    if scene.solve.data_term == "warped":
        images = tuple(_pair(view, n, captures, drifts_px[n]) for n, view in enumerate(scene.views))
    if standing.things:
        shifts = past_objects(standing.scene, shifts)
        views = [_in_windows(*of) for of in zip(views, shifts, strict=True)]
    bursts = tuple(zip(*views, strict=True))
    return Measurement(
        captures,
        tuple(shifts),
        tuple(drifts_px),
        tuple(notes),
        standing.scene,
        images,
        bursts,
        standing.things,
    )


def _pair(view: View, index: int, captures: CapturePair, drift_px: Motion) -> ImagePair:
    before, after = (_picture(capture, index) for capture in (captures.reference, captures.flow))
    variance = _variance(captures.reference, index, view) + _variance(captures.flow, index, view)
    return ImagePair(move_image(before, drift_px, view.camera), after, float(variance.mean()))


def _picture(capture: Capture, index: int) -> Image:
    """The mean picture of a view, as the lens drew it."""
    return without_defects(capture.images[index].mean)


def _variance(capture: Capture, index: int, view: View) -> np.ndarray:
    """Variance of the mean picture's pixels: by the calibrated camera, or by the frames of another one."""
    image = capture.images[index]
    if capture.manifest.get("origin", {}).get("rig") != "imported" or image.frames < 2:
        return frame_variance(image.mean, view.noise) / image.frames
    about = capture.manifest["views"][index]
    levels = np.array([record["level"] for record in about["records"]])
    flicker, step = float(levels.std(ddof=1) / max(levels.mean(), 1e-9)), 1.0 / about["full_scale_counts"]
    return scattered_variance(image.mean, image.std, image.frames, flicker, step) / image.frames


def _measure_view(
    scene: Scene, index: int, view: View, captures: CapturePair, covered: np.ndarray
) -> tuple[ShiftMeasurement, Motion, str]:
    exposures = _exposures(scene, index, captures.reference, captures.flow)
    check_pair(captures.reference, captures.flow, index, exposures.variance)
    shape, window_px = exposures.before.shape, exposures.window_px
    in_room, beyond = _wall_and_beyond(scene, index, shape, window_px)
    prior, said = mount(view.drift_std_px), ""
    if captures.after is not None:
        found = between_references(captures, scene, index)
        prior, said = found.at(_share(captures.reference, captures.flow, captures.after)), f"{found.said} "
    shift, drift_px, note = without_known_drift(
        exposures, in_room, beyond, prior, _marks(view, shape, window_px)
    )
    return _in_room(shift, in_room, covered, shape, drift_px, said + note)


def _wall_and_beyond(scene: Scene, index: int, shape: tuple[int, int], window_px: int) -> tuple[Mask, Mask]:
    """The windows on the back wall, and those beyond it that may be still, in a picture of `shape`."""
    centres = window_centres(shape, window_px)
    in_room = sees_wall(scene, index, centres, margin_px=float(window_px))
    # The wall's own edge, seen through the room's air, must not reach into a window that counts as still, nor into
    # the filter of its gradient.
    reach_px = 0.5 * window_px + len(derivative_filter()) // 2
    beyond = ~sees_wall(scene, index, centres, margin_px=-reach_px)
    beyond &= ~hidden_by_objects(scene, index, centres, margin_px=float(window_px))
    for marks in scene.views[index].marks:
        beyond &= ~within_marks(marks, centres, -float(window_px))
    return in_room, beyond & _whole(centres, shape)


def _marks(view: View, shape: tuple[int, int], window_px: int) -> list[Yardstick]:
    """The windows that lie wholly in each of a view's marks."""
    centres = window_centres(shape, window_px)
    whole, reach_px = _whole(centres, shape), 0.5 * window_px + len(derivative_filter()) // 2
    return [
        Yardstick(f"marks {one.name!r}", whole & within_marks(one, centres, reach_px)) for one in view.marks
    ]


def _alone(scene: Scene, index: int, mean: Image, window_px: int) -> Callable[[Capture], ShiftMeasurement]:
    """How the pattern moved from the mean picture of a sequence to one of its bursts.

    The information is that of the burst's own noise.
    """
    view = scene.views[index]
    in_room, beyond = _wall_and_beyond(scene, index, mean.shape, window_px)
    marks = _marks(view, mean.shape, window_px)

    def measured(burst: Capture) -> ShiftMeasurement:
        variance = uniform_filter(_variance(burst, index, view), 2 * window_px)
        exposures = Exposures(mean, _picture(burst, index), variance, window_px, view.camera)
        return without_known_drift(exposures, in_room, beyond, mount(view.drift_std_px), marks)[0]

    return measured


def _in_windows(
    bursts: tuple[ShiftMeasurement, ...], shift: ShiftMeasurement
) -> tuple[ShiftMeasurement, ...]:
    """The bursts in the windows of `shift` alone."""
    return tuple(burst.at(windows_among(burst.centres_px, shift.centres_px)) for burst in bursts)


def between_references(captures: CapturePair, scene: Scene, index: int = 0) -> Agreement:
    """How the camera moved between the references around a flow. Raises BadInputError where there is one only."""
    if captures.after is None:
        raise BadInputError(
            "The newest flow was not taken between two references. Take all three: airlens capture series"
        )
    exposures = _exposures(scene, index, captures.reference, captures.after)
    centres = window_centres(exposures.before.shape, exposures.window_px)
    return agreement(exposures, sees_wall(scene, index, centres, margin_px=float(exposures.window_px)))


def _exposures(scene: Scene, index: int, first: Capture, second: Capture) -> Exposures:
    view = scene.views[index]
    variance = _variance(first, index, view) + _variance(second, index, view)
    window_px = resolve_window_px(scene, view)
    # One weight a window: pixel by pixel the darkest would weigh a thousandfold, and with them what the
    # model leaves out there (clipping, aliasing), which biases a drift of 0.1 px by 1 %.
    before, after = (_picture(capture, index) for capture in (first, second))
    return Exposures(before, after, uniform_filter(variance, 2 * window_px), window_px, view.camera)


def _share(*captures: Capture) -> float:
    """When the second of three captures of a series was taken, as a share of the time from the first to the last."""
    first_s, flow_s, last_s = (float(one.manifest["origin"]["series"]["began_s"]) for one in captures)
    return float(np.clip((flow_s - first_s) / (last_s - first_s), 0.0, 1.0)) if last_s > first_s else 0.5


def _in_room(
    shift: ShiftMeasurement,
    in_room: np.ndarray,
    covered: np.ndarray,
    shape: tuple[int, int],
    drift_px: Motion,
    note: str,
) -> tuple[ShiftMeasurement, Motion, str]:
    """The good windows that see the room's wall; what was refused is told."""
    hidden = covered[in_room]
    if hidden.any():
        note += (
            f" Something stands before {100 * float(hidden.mean()):.1f} % of the wall: the reference does not show "
            "the pattern there. These windows and those beside them are left out."
        )
    shift = shift.at(in_room & ~reached_from(covered, shape, shift.window_px))
    if shift.refused is not None and np.any(shift.refused):
        refused = float(shift.refused.mean())
        note += (
            f" {100 * refused:.3g} % of the windows show something else than the pattern, moved, in one of the "
            "pictures (a person, a reflection, another light), and are left out."
        )
    return shift.good(), drift_px, note


def _whole(centres_px: np.ndarray, shape: tuple[int, int]) -> np.ndarray:
    """Windows whose gradient does not reach beyond the picture's edge."""
    edge = len(derivative_filter()) // 2
    return np.all((centres_px > edge) & (centres_px < np.array(shape[::-1]) - 1 - edge), axis=1)


def _check_captures(reference: Capture, flow: Capture, scene: Scene) -> None:
    for capture in (reference, flow):
        if len(capture.images) != len(scene.views):
            raise BadInputError(
                f"{capture.folder} does not fit the scene: views pictured {len(capture.images)}, stated "
                f"{len(scene.views)}. Capture again with this scene."
            )
        for image, view in zip(capture.images, scene.views, strict=True):
            expected = (view.camera.height_px, view.camera.width_px)
            if image.mean.shape != expected:
                raise BadInputError(
                    f"{capture.folder}: the {capture.role} image is {image.mean.shape[1]} x "
                    f"{image.mean.shape[0]} px; the calibrated camera {view.name!r} has {expected[1]} x "
                    f"{expected[0]} px. Calibrate this camera, or capture at its size."
                )
            saturated = float(np.mean(image.mean > 0.995))
            if saturated > 0.01:
                raise BadInputError(
                    f"{capture.folder}: {100 * saturated:.1f} % of the {capture.role} image is saturated; "
                    "expected below 1 %. Shorten the exposure or dim the light, and capture both again."
                )
