"""How a scene is rendered: its `auto` values resolved for one view and one field."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from core.fields import AbstractField, GridField, SplineField
from core.rays import AbstractRayTracer, NonlinearTracer, QuasiLinearTracer, StraightTracer
from core.scene import Scene
from core.setting import SettingError

_LEAST_STEPS, _MOST_STEPS = 64, 512
# With fewer the replicas of the pattern alias in the camera: shifts wrong by 0.5 % with 4, 0.1 % with 9.
_SAMPLES = 9
# Features of room air are no finer; what a cone blurs below that is not seen.
_WIDE_CONE_M = 0.02
# Rays a cell of the field along each axis of the sensor, from which neighbours may share one.
_RAYS_A_CELL = 8


class RenderChoice(eqx.Module):
    """Settled values. `stride` pixels share a traced ray; 0 traces every sample of a pixel by itself."""

    tracer: AbstractRayTracer
    projector_order: int = eqx.field(static=True)
    irradiance: bool = eqx.field(static=True)
    samples: int = eqx.field(static=True)
    stride: int = eqx.field(static=True)
    aperture_m: float | None = eqx.field(static=True)


def choose(scene: Scene, view: int, field: AbstractField | None) -> RenderChoice:
    """Resolve every `auto` of `scene.rays`.

    Tracer: nonlinear, which costs no more than the others. Steps: two a plane of a grid, 64 to 512. Projector
    order: 1 leaves 1e-4 of the shift at 10 K; 2 from a fifth of the ambient refractivity (about 70 K) on.
    Irradiance: off (a change of brightness of the flow's size, not the pattern's). Aperture cone: when its
    disc in the middle of the room is wider than 2 cm. Rays are shared where a cell of the
    field covers many pixels. Raises SettingError for a cone without f_number and focal_m.
    """
    rays = scene.rays
    cell_m = _cell_m(scene, field)
    planes = 1 + round(scene.room.size_m[1] / cell_m)
    steps = min(_MOST_STEPS, max(_LEAST_STEPS, 2 * planes)) if rays.steps == "auto" else rays.steps
    kinds = {"straight": StraightTracer, "quasi_linear": QuasiLinearTracer}
    tracer = kinds.get(rays.tracer, NonlinearTracer)(steps, scene.air.ambient_refractivity)
    order = rays.projector_order
    if order == "auto":
        order = 2 if _strength(scene, field) > 0.2 else 1
    return RenderChoice(
        tracer,
        projector_order=order,
        irradiance=rays.irradiance is True,
        samples=_SAMPLES if rays.samples_per_pixel == "auto" else rays.samples_per_pixel,
        stride=_stride(scene, view, cell_m),
        aperture_m=_aperture_m(scene, view),
    )


def _cell_m(scene: Scene, field: AbstractField | None) -> float:
    """Smallest spacing of a grid; a fiftieth of the room's depth for other fields."""
    if isinstance(field, GridField):
        return min(field.spacing_m)
    if isinstance(field, SplineField):
        counts = [n - 3 for n in field.coefficients.shape]
        return min(s / n for s, n in zip(scene.room.size_m, counts, strict=True))
    return scene.room.size_m[1] / 50


def _strength(scene: Scene, field: AbstractField | None) -> float:
    """Largest excess over ambient refractivity; unknown fields count as strong."""
    if field is None:
        return 0.0
    if isinstance(field, GridField):
        return float(np.abs(np.asarray(field.values)).max()) / scene.air.ambient_refractivity
    if isinstance(field, SplineField):
        return float(jnp.abs(field.coefficients).max()) / scene.air.ambient_refractivity
    return 1.0


def _pixel_m(scene: Scene, view: int) -> float:
    """Size of a pixel on the wall straight ahead."""
    camera = scene.views[view].camera
    return (scene.room.upper_m[1] - camera.position_m[1]) / min(camera.focal_px)


def _stride(scene: Scene, view: int, cell_m: float) -> int:
    pixels_a_cell = cell_m / _pixel_m(scene, view)
    if pixels_a_cell < 4:
        return 0
    return max(1, int(pixels_a_cell / _RAYS_A_CELL))


def _aperture_m(scene: Scene, view: int) -> float | None:
    """Diameter of the lens, if its cone is to be traced."""
    asked, eye = scene.rays.aperture_cone, scene.views[view]
    if asked is False:
        return None
    if eye.f_number is None or eye.focal_m is None:
        if asked is True:
            raise SettingError(
                f"View {eye.name!r} asks for an aperture cone without f_number and focal_m; give both."
            )
        return None
    diameter_m = eye.focal_m / eye.f_number
    to_wall_m = scene.room.upper_m[1] - eye.camera.position_m[1]
    # Focused on the wall, a lens sees a point half a room in front of it through this disc.
    disc_m = diameter_m * 0.5 * scene.room.size_m[1] / to_wall_m
    return diameter_m if asked is True or disc_m > _WIDE_CONE_M else None
