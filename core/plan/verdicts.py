"""Verdicts in words: what this rig can see, and what would help where it cannot."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from core.plan.averaging import Fluctuation
from core.plan.choice import Choice
from core.plan.expected import ExpectedFlow
from core.plan.observability import Seen
from core.plan.second_light import SecondLight
from core.plan.signal import VISIBLE, Signal, lever_m
from core.rays.visibility import hidden_by_objects, sees_wall
from core.scene import ProjectedPattern, Scene
from core.view_frame import facing, turn_of

# Below this a picture's signal is less than its noise, all windows together.
BLIND = 1.0
_SAME_PLACE_M = 0.01
# Places of the picture, an axis, where the wall is looked for; a share of the wall that is much to hide.
_PROBES, _TOO_MUCH = 64, 0.4


def in_short(picture_snr: float) -> str:
    """One sentence before all others: whether the picture as a whole shows the expected air."""
    times = f"the picture as a whole shows it {picture_snr:.2g} times as strongly as its noise"
    if picture_snr < BLIND:
        return (
            f"This rig does not see the expected air: {times}. What it would find comes from what is stated of the "
            "room. Change the rig before you capture."
        )
    if picture_snr < VISIBLE:
        return f"This rig sees the expected air weakly: {times}. Much of the rest comes from what is stated."
    return f"This rig sees the expected air: {times}."


def verdict(scene: Scene, view: int, flow: ExpectedFlow, found: Signal, other_p99_px: float) -> str:
    """One view's sentences: visible or not, what it would need, and how much of the wall objects hide."""
    said = _verdict(*facing(scene, view), flow.facing(turn_of(scene, view)), found, other_p99_px)
    return said + hidden_wall(scene, view, found.noise.window_px)


def hidden_wall(scene: Scene, view: int, window_px: int) -> str:
    """A sentence on the share of the wall that objects hide from this view; empty where they hide none."""
    camera = scene.views[view].camera
    columns, rows = (np.linspace(0, n - 1, _PROBES) for n in (camera.width_px, camera.height_px))
    pixels = np.stack(np.meshgrid(columns, rows), axis=-1).reshape(-1, 2)
    on_wall = sees_wall(replace(scene, objects=()), view, pixels, margin_px=float(window_px))
    hidden = on_wall & hidden_by_objects(scene, view, pixels, margin_px=float(window_px))
    share = hidden.sum() / max(on_wall.sum(), 1)
    if share == 0:
        return ""
    said = f" Objects hide {100 * share:.0f} % of the wall, and nothing is measured there."
    if share > _TOO_MUCH:
        said += " That is much: move the camera, or what stands before the wall, to see more of it."
    return said


def _verdict(scene: Scene, view: int, flow: ExpectedFlow, found: Signal, other_p99_px: float) -> str:
    name, frames = scene.views[view].name, scene.views[view].frames
    size = found.shift.percentile_px(99)
    if not np.isfinite(found.noise.mean_px):
        return f"{name}: the wall shows no pattern that this camera resolves; nothing can be measured."
    if size == 0 and _same_place(scene, view):
        return (
            f"{name}: camera and projector stand in one place and see exactly no shift. "
            "Move the projector at least 1 m away, or print the pattern."
        )
    seen = (
        f"{name}: the pattern would move by up to {size:.2g} px, {found.snr:.2g} times the noise of a "
        f"window ({found.noise.mean_px:.2g} px from {frames} frames)"
    )
    if found.snr >= VISIBLE:
        return f"{seen}. Differences down to {found.smallest_visible_k:.2g} K stand out in one window."
    return (
        f"{seen}; {VISIBLE:g} times are needed. This rig cannot see {found.contrast_k:.2g} K in one window: it would "
        f"need {' or '.join(_remedies(scene, view, flow, found, other_p99_px))}."
    )


def _same_place(scene: Scene, view: int) -> bool:
    if not isinstance(scene.light, ProjectedPattern):
        return False
    apart = np.subtract(scene.light.projector.position_m, scene.views[view].camera.position_m)
    return float(np.linalg.norm(apart)) < _SAME_PLACE_M


def _remedies(scene: Scene, view: int, flow: ExpectedFlow, found: Signal, other_p99_px: float) -> list[str]:
    """Each alone would make the flow visible."""
    missing = VISIBLE / max(found.snr, 1e-12)
    frames = scene.views[view].frames * missing**2
    # A finer sensor sees a larger shift in pixels, in windows of more pixels.
    pixels = scene.views[view].camera.width_px * missing**0.5
    offered = [f"{_rounded_up(frames)} frames"] if frames < 1e6 else []
    if pixels < 20_000:
        offered.append(f"a camera of {_rounded_up(pixels)} px across")
    lever = lever_m(scene, flow) * (missing - 1)
    if lever < 10:
        offered.append(f"a wall {lever:.1f} m further behind the flow")
    if isinstance(scene.light, ProjectedPattern):
        apart = np.subtract(scene.light.projector.position_m, scene.views[view].camera.position_m)
        baseline = float(np.linalg.norm(apart)) * missing
        if baseline < 5:
            offered.append(f"the projector {baseline:.1f} m from the camera")
        if other_p99_px >= found.shift.percentile_px(99) * missing:
            offered.append("a printed pattern on the wall")
    return offered or ["a flow with larger differences: no reasonable rig sees this one"]


def _rounded_up(value: float) -> int:
    """Two leading digits, upwards."""
    digits = 10 ** max(0, int(np.floor(np.log10(max(value, 1.0)))) - 1)
    return int(np.ceil(value / digits) * digits)


def blindness(found: Seen, names: Sequence[str]) -> str:
    """What the pictures of these views leave open, what each view adds, and what the boundary adds."""
    return _added(found, names) + (
        f"The images fix {found.modes_seen} of {found.modes} smooth patterns of temperature: "
        f"{100 * found.images:.0f} % of an unknown flow's variance; what is known at the boundary alone "
        f"{100 * found.boundary:.0f} %, both {100 * found.both:.0f} %. What varies along the line of sight "
        "only is in none of the pictures."
    )


def _added(found: Seen, names: Sequence[str]) -> str:
    if len(names) < 2:
        return ""
    alone, *more = found.first_views
    said = [f"{names[0]!r} alone fixes {100 * alone:.0f} %"]
    said += [f"with {name!r} it is {100 * share:.0f} %" for name, share in zip(names[1:], more, strict=True)]
    return f"Of an unknown flow's variance {', '.join(said)}. "


def offered(found: SecondLight | None) -> list[str]:
    """A second projector, where it would find more than the frames that it takes; nothing elsewhere."""
    if found is None or not found.helps:
        return []
    x, y, z = found.position_m
    return [
        f"A second projector at ({x:.1f}, {y:.1f}, {z:.1f}) m, on the other side of the camera, that lights the same "
        f"wall in turn would raise what the images fix to {100 * found.images:.0f} %; as many frames under the one "
        f"that is there, to {100 * found.twice_the_frames:.0f} %. State it as a further "
        "projector (a view with camera_of)."
    ]


def moving(air: Fluctuation | None) -> list[str]:
    """How the air would move about its mean, and how long to average; nothing where no turbulence is expected."""
    if air is None:
        return []
    wished = "; ".join(
        f"to {error_k:g} K, {_time(air.seconds_for(error_k))}" for error_k in air.round_errors_k()
    )
    stays_s = float(f"{air.time_s:.1g}")
    return [
        f"The air moves: T fluctuates in time by {air.std_k:.2g} K (rms), for some {stays_s:g} s at a time. "
        f"How long to average (capture flow --bursts, --every-s) to know the mean {wished}."
    ]


def _time(seconds: float) -> str:
    """Two leading digits, in the unit that reads best."""
    for unit, length_s in (("h", 3600.0), ("min", 60.0)):
        if seconds >= 1.5 * length_s:
            return f"{seconds / length_s:.2g} {unit}"
    return f"{seconds:.2g} s"


def broken(choices: tuple[Choice, ...]) -> list[str]:
    """Choices whose bound is above the limit even at the dearest setting."""
    return [
        f"{c.name} = {c.value}: its bound {c.bound:.2g} {c.unit} is above the limit {c.limit:.2g} {c.unit}; "
        "expect an error of that size."
        for c in choices
        if not c.holds
    ]
