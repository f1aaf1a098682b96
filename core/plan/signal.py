"""The expected shift of a view against its noise: map, percentiles, and what would help.

Signal to noise is that of one window at the 99th percentile of the shift. The shift is linear in the
contrast while that is small against T0, falls with the noise's square root of frames, and grows with the
lever from the flow to the wall and, lit by a projector, with the baseline.
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from core.displacement import window_centres
from core.plan.expected import ExpectedFlow
from core.plan.shift_noise import ShiftNoise
from core.rays.operator import build
from core.rays.visibility import sees_wall
from core.scene import FixedTexture, ProjectedPattern, Scene
from core.setting import SettingError
from core.view_frame import each_alone

# A flow is visible if the 99th percentile of its shift is three standard deviations of a window.
VISIBLE = 3.0
_MOST_WINDOWS = 3000
_ASSUMED_BASELINE_M = 1.0


@dataclass(frozen=True)
class ShiftMap:
    """Displacements at window centres, (column, row); `stride` of the measured windows are shown."""

    centres_px: Float[np.ndarray, "windows 2"]
    displacement_px: Float[np.ndarray, "windows 2"]
    stride: int

    def percentile_px(self, share: int) -> float:
        """A percentile of the displacements' length."""
        return float(np.percentile(np.linalg.norm(self.displacement_px, axis=1), share))


@dataclass(frozen=True)
class Signal:
    """Shift and noise of one view, and the contrast that is just visible in one window."""

    shift: ShiftMap
    noise: ShiftNoise
    contrast_k: float
    ambient_k: float

    @property
    def snr(self) -> float:
        """99th percentile of the shift over one deviation of a window."""
        return self.shift.percentile_px(99) / max(self.noise.mean_px, 1e-300)

    @property
    def picture_snr(self) -> float:
        """Signal to noise of the whole picture, for a flow of known shape."""
        whitened = self.shift.displacement_px / np.array(self.noise.std_px)
        return float(self.shift.stride * np.sqrt(np.sum(whitened**2)))

    @property
    def smallest_visible_k(self) -> float:
        """The contrast at which the flow is just visible in one window; infinite where no heat suffices."""
        # Refractivity falls by dT / (T0 + dT) of itself, and can fall no further than to nothing.
        share = self.contrast_k / (self.ambient_k + self.contrast_k) * VISIBLE / max(self.snr, 1e-150)
        return self.ambient_k * share / (1.0 - share) if share < 1.0 else float("inf")

    @property
    def frames_factor(self) -> float:
        """How many times the frames would make the flow visible (below 1: fewer would do)."""
        return (VISIBLE / max(self.snr, 1e-150)) ** 2


def signal(scene: Scene, view: int, flow: ExpectedFlow, noise: ShiftNoise) -> Signal:
    """What `view` sees of `flow`. Raises SettingError for a view that sees nothing of the wall."""
    contrast_k = float(np.abs(flow.excess_k).max())
    shift = shift_map(scene, view, flow, noise.window_px)
    return Signal(shift, noise, contrast_k, scene.air.ambient_temperature_k)


def shift_map(scene: Scene, view: int, flow: ExpectedFlow, window_px: int) -> ShiftMap:
    """Expected displacements over the back wall, thinned to at most some 3000 windows."""
    camera = scene.views[view].camera
    shape = (camera.height_px, camera.width_px)
    rows, columns = (side // window_px for side in shape)
    stride = max(1, int(np.ceil(np.sqrt(rows * columns / _MOST_WINDOWS))))
    centres = window_centres(shape, window_px).reshape(rows, columns, 2)
    centres = centres[stride // 2 :: stride, stride // 2 :: stride].reshape(-1, 2)
    centres = centres[sees_wall(scene, view, centres, margin_px=float(window_px))]
    if not len(centres):
        raise SettingError(
            f"View {scene.views[view].name!r} has no window of {window_px} px on the back wall "
            f"y = {scene.room.upper_m[1]:g} m. Turn the camera to the wall, or choose a smaller window_px."
        )
    operator = build(scene, view, centres, flow.grid.shape, float(window_px))
    found = operator.apply(flow.excess_refractivity(scene.air))
    return ShiftMap(centres, np.asarray(found, np.float64), stride)


def other_light(scene: Scene, view: int) -> Scene:
    """The same scene under the other kind of light: a print, or a projector one metre beside the camera."""
    scene = each_alone(scene)
    if isinstance(scene.light, ProjectedPattern):
        return replace(scene, light=FixedTexture(pattern=scene.light.pattern))
    camera = scene.views[view].camera
    x, y, z = camera.position_m
    beside = replace(camera, position_m=(x + _ASSUMED_BASELINE_M, y, z), width_px=4 * camera.width_px)
    # The panel is wide enough for the shifted picture: only rays matter here.
    stand_off_m = scene.room.upper_m[1] - y
    cx, cy = camera.principal_px
    beside = replace(beside, principal_px=(cx + camera.focal_px[0] * _ASSUMED_BASELINE_M / stand_off_m, cy))
    return replace(scene, light=ProjectedPattern(pattern=scene.light.pattern, projector=beside))


def lever_m(scene: Scene, flow: ExpectedFlow) -> float:
    """Mean distance from the flow to the back wall, by the size of its horizontal gradients."""
    strength = np.abs(np.diff(flow.excess_k, axis=0)).sum(axis=(0, 2))
    y_m = flow.grid.axes_m[1]
    return float(np.sum(strength * (scene.room.upper_m[1] - y_m)) / max(np.sum(strength), 1e-300))
