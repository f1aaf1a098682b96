"""Ten scenes from a candle on a bench to a hall, seen by a small camera: what `auto` is judged on."""

from dataclasses import replace

from core.geometry import Box, looking_along_y
from core.scene import CameraNoise, FixedTexture, ProjectedPattern, Scene, View, WaveletPattern

WINDOW_PX = 16


def bench(
    *, edge_m: float = 3.0, stand_off_m: float = 12.0, width_px: int = 256, frames: int = 4, baseline_m=None
) -> Scene:
    """A cubic room of `edge_m` before a camera; lit by a projector where `baseline_m` is given."""
    room = Box(lower_m=(0.0, 0.0, 0.0), upper_m=(edge_m, edge_m, edge_m))
    focal_px = 1.1 * width_px * stand_off_m / edge_m

    def optics(aside_m: float):
        return looking_along_y(
            position_m=(edge_m / 2 + aside_m, edge_m - stand_off_m, edge_m / 2),
            width_px=width_px,
            height_px=width_px,
            focal_px=focal_px,
            principal_px=((width_px - 1) / 2 + focal_px * aside_m / stand_off_m, (width_px - 1) / 2),
        )

    pattern = WaveletPattern(finest_px=10.0)
    light = FixedTexture(pattern=pattern, pixel_m=0.5 * stand_off_m / focal_px)
    if baseline_m is not None:
        light = ProjectedPattern(pattern=replace(pattern, finest_px=6.0), projector=optics(baseline_m))
    noise = CameraNoise(full_well_e=5000.0)
    return Scene(room=room, views=(View(camera=optics(0.0), noise=noise, frames=frames),), light=light)


SCENES = {
    # name: edge of the room, stand-off [m], contrast [K], baseline [m], camera [px], frames
    "a candle on a bench": (0.3, 1.0, 800.0, None, 2048, 400),
    "a soldering iron": (0.3, 1.2, 300.0, None, 1024, 100),
    "a computer": (1.0, 3.0, 15.0, None, 256, 4),
    "a person": (2.5, 8.0, 8.0, None, 512, 16),
    "an office": (4.0, 12.0, 5.0, None, 256, 4),
    "an office, projected": (4.0, 12.0, 5.0, 1.0, 512, 100),
    "a heater, projected": (3.0, 12.0, 60.0, 0.5, 1024, 400),
    "a fire, projected": (3.0, 12.0, 1000.0, 1.0, 2048, 100),
    "a lecture hall": (12.0, 30.0, 5.0, None, 256, 4),
    "a hall": (30.0, 60.0, 3.0, None, 2048, 1000),
}


def named(name: str) -> tuple[Scene, float]:
    """One of the ten, and its contrast in kelvin."""
    edge_m, stand_off_m, excess_k, baseline_m, width_px, frames = SCENES[name]
    scene = bench(
        edge_m=edge_m, stand_off_m=stand_off_m, baseline_m=baseline_m, width_px=width_px, frames=frames
    )
    return scene, excess_k
