"""How fine a printed pattern may be for a camera at its distance, and whether the scene's is."""

from core.geometry import Box, Optics
from core.plan.choice import Choice
from core.scene import DotPattern, FixedTexture, Pattern, Scene, WaveletPattern
from core.view_frame import facing

# Finer bands alias in the camera: at 3 px a drift of 0.1 px is measured 0.6 % wrong, at 5 px 0.2 %.
LEAST_PERIOD_PX = 5.0
_ERROR_PERCENT = 0.2
# A print is described twice as fine as the camera's pixels.
PATTERN_PX_A_PIXEL = 2


def camera_pixel_m(camera: Optics, room: Box) -> float:
    """One pixel's width on the back wall, straight ahead."""
    return (room.upper_m[1] - camera.position_m[1]) / camera.focal_px[0]


def coarsest(scene: Scene, view: int | None = None) -> tuple[Optics, Box]:
    """Of the cameras that see by a view's light the one of the largest pixels on its wall, in its own frame.

    Without a view by the scene's light.
    """
    light = None if view is None else scene.views[view].light
    seeing = [n for n, one in enumerate(scene.views) if one.light == light] or list(range(len(scene.views)))
    frames = [facing(scene, n) for n in seeing]
    found = [(own.views[n].camera, own.room) for own, n in frames]
    return max(found, key=lambda of: camera_pixel_m(*of))


def suited_print(camera: Optics, distance_m: float, seed: int) -> FixedTexture:
    """The print for a camera at this distance: its finest period covers five camera pixels."""
    pixel_m = distance_m / camera.focal_px[0] / PATTERN_PX_A_PIXEL
    finest_px = LEAST_PERIOD_PX * PATTERN_PX_A_PIXEL
    return FixedTexture(pattern=WaveletPattern(seed=seed, finest_px=finest_px), pixel_m=pixel_m)


def finest_period_m(light: FixedTexture) -> float:
    """The print's finest period on the wall; of dots and squares, twice their size."""
    return finest_period_px(light.pattern) * light.pixel_m


def finest_period_px(pattern: Pattern) -> float:
    """The finest period in pattern pixels."""
    if isinstance(pattern, WaveletPattern):
        return pattern.finest_px
    return 2.0 * (pattern.diameter_px if isinstance(pattern, DotPattern) else pattern.square_px)


def period_in_camera_px(light: FixedTexture, scene: Scene, view: int | None = None) -> float:
    """The finest period in pixels of the camera that sees it coarsest, were the view or the scene lit so."""
    return finest_period_m(light) / camera_pixel_m(*coarsest(scene, view))


def finest_period(light: FixedTexture, scene: Scene) -> Choice:
    """The print's finest period: its aliasing against that of five camera pixels, which grows as 1 / period^2."""
    # Rounded, so that a period of five pixels that was computed is five pixels.
    period_px = round(period_in_camera_px(light, scene), 6)
    bound = _ERROR_PERCENT * (LEAST_PERIOD_PX / period_px) ** 2
    if bound <= _ERROR_PERCENT:
        reason = f"aliasing makes a shift at most {bound:.1g} % wrong"
    else:
        reason = f"too fine for this camera: print it {LEAST_PERIOD_PX / period_px:.2g} times as large"
    value = f"{1e3 * finest_period_m(light):.3g} mm, {period_px:.3g} camera px"
    return Choice("print's finest period", value, bound, _ERROR_PERCENT, "%", 1.0, reason)
