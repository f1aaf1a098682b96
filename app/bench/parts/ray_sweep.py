"""What each ray model, number of steps and projector order costs a shift, beside the dearest of them."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import equinox as eqx
import numpy as np
from jaxtyping import Float

from app.volume.file import RoomVolume
from app.volume.measurement import fine_field
from app.volume.scene import RigOptions, room_scene
from core.displacement import resolve_window_px, window_centres
from core.fields import AbstractField
from core.plan.ray_choices import tracer_of
from core.plan.shift_noise import shift_noise
from core.rays.visibility import sees_wall
from core.render import pixel_geometry
from core.render.shift import wall_offset_m
from core.scene import ProjectedPattern, Scene

KINDS = ("straight", "quasi_linear", "nonlinear")
DEAREST_STEPS, DEAREST_ORDER = 512, 3
_STEPS = (16, 64, 256)
_WINDOWS = 1000


@dataclass(frozen=True)
class Traced:
    """Offsets of rays on the wall, in camera pixels, and the operations that they took."""

    offset_px: Float[np.ndarray, "rays 3"]
    operations: float

    def off_px(self, exact: "Traced") -> float:
        """Largest difference of any ray."""
        return float(np.abs(self.offset_px - exact.offset_px).max())


def traced(
    scene: Scene, field: AbstractField, pixels: Float[np.ndarray, "rays 2"], kind: str, steps: int, order: int
) -> Traced:
    """One choice on rays of the first view; operations are those of the compiled program, per step."""
    camera = scene.views[0].camera
    geometry, tracer = pixel_geometry(scene, 0, pixels), tracer_of(kind, steps, scene)
    program = eqx.filter_jit(wall_offset_m).lower(geometry, field, tracer, order).compile()  # pyright: ignore
    costs = program.compiled.cost_analysis()  # pyright: ignore
    px_per_m = max(camera.focal_px) / (scene.room.upper_m[1] - camera.position_m[1])
    offset = np.asarray(program(geometry, field, tracer, order), np.float64) * px_per_m
    # The compiler counts a loop's body once.
    return Traced(offset, float(costs["flops"]) * steps / len(pixels))


def ray_sweep(name: str, volume: RoomVolume) -> Iterator[dict[str, Any]]:
    """Every model, step count and order on one room, lit by a texture and by a projector."""
    for light in ("texture", "projector"):
        scene = room_scene(volume, RigOptions(light=light), "paper")
        window_px = resolve_window_px(scene, scene.views[0])
        pixels = _pixels(scene, window_px)
        noise_px = shift_noise(scene, 0, window_px).mean_px
        field = fine_field(volume, scene)
        orders = (1, 2) if isinstance(scene.light, ProjectedPattern) else (1,)
        exact = traced(scene, field, pixels, "nonlinear", DEAREST_STEPS, DEAREST_ORDER)
        for kind in KINDS:
            for steps in _STEPS:
                for order in orders:
                    one = traced(scene, field, pixels, kind, steps, order)
                    off_px = one.off_px(exact)
                    yield {
                        "room": name, "light": light, "rays": kind, "steps": steps, "order": order,
                        "off_px": float(f"{off_px:.3g}"), "off_noise": float(f"{off_px / noise_px:.3g}"),
                        "operations_a_ray": round(one.operations),
                    }  # fmt: skip


def _pixels(scene: Scene, window_px: int) -> Float[np.ndarray, "rays 2"]:
    """Centres of windows that see the patterned wall, thinned to about a thousand."""
    camera = scene.views[0].camera
    centres = window_centres((camera.height_px, camera.width_px), window_px).astype(np.float64)
    seen = centres[sees_wall(scene, 0, centres, margin_px=float(window_px))]
    return seen[:: max(1, len(seen) // _WINDOWS)]
