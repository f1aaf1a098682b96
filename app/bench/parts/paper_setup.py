"""The paper's simulated measurement to the letter: two samples a pixel, shared by data and model.

100 x 100 px, a projector one metre to the right, wavelet noise, the plane x_min known. The flow image is
rendered by tracing both rays of every sample through the volume resampled twice as fine.
"""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from app.volume.file import RoomVolume
from app.volume.measurement import fine_field, known_planes, tracer_of
from app.volume.scene import RigOptions, room_scene
from core.fields import GridField
from core.problem import ImagePair, Problem
from core.rays import NonlinearTracer
from core.render.light import pattern_image, sample_pattern
from core.render.pixel_geometry import PixelGeometry, pixel_geometry
from core.render.shift import pattern_offset_px, wall_offset_m
from core.scene import Scene, SolveModel

PIXELS = 100
SAMPLES = 2


def paper_problem(volume: RoomVolume, *, seed: int, image_std: float | None = None) -> Problem:
    """Images, the rendered data term, and the known plane.

    The pictures' difference scatters by `image_std` of full scale; None: by the default camera's noise. The
    publication names no noise.
    """
    options = RigOptions(
        camera_px=(PIXELS, PIXELS),
        light="projector",
        stand_off_m=30.5,
        baseline_m=(1.0, 0.0),
        border_px=0,
    )
    made = room_scene(volume, options, "paper")
    scene = Scene(
        room=made.room,
        air=made.air,
        views=made.views,
        light=made.light,
        boundary=made.boundary,
        solve=SolveModel(data_term="rendered"),
    )
    generator = np.random.default_rng(seed)
    offsets = _triangular(generator, (PIXELS, PIXELS, SAMPLES, 2))
    reference, flow = _images(scene, fine_field(volume, scene), offsets)
    std = _camera_std(scene, reference) if image_std is None else image_std
    noisy = flow + std * generator.standard_normal(flow.shape)
    pair = ImagePair(reference, noisy, std**2, offsets)
    return Problem(scene, (), known_planes(volume, scene), images=(pair,))


def _camera_std(scene: Scene, picture: Float[np.ndarray, "rows cols"]) -> float:
    """Shot noise of a mean frame, full scale 1; both images carry it."""
    view = scene.views[0]
    return (2 * float(picture.mean()) / view.noise.full_well_e / view.frames) ** 0.5


def _triangular(generator: np.random.Generator, shape: tuple[int, ...]) -> np.ndarray:
    """Positions distributed as the triangle filter, so that samples weigh equally."""
    return generator.uniform(-0.5, 0.5, shape) + generator.uniform(-0.5, 0.5, shape)


def _images(
    scene: Scene, field: GridField, offsets: Float[np.ndarray, "rows cols samples 2"]
) -> tuple[Float[np.ndarray, "rows cols"], Float[np.ndarray, "rows cols"]]:
    row, column = np.mgrid[0:PIXELS, 0:PIXELS]
    positions = (np.stack([column, row], -1)[:, :, None] + offsets).reshape(-1, 2)
    geometry = pixel_geometry(scene, 0, positions)
    tracer = tracer_of(scene)
    reference, flow = _luminance(jnp.asarray(pattern_image(scene)), geometry, field, tracer)
    shape = (PIXELS, PIXELS, SAMPLES)
    return (
        np.asarray(reference, np.float64).reshape(shape).mean(-1),
        np.asarray(flow, np.float64).reshape(shape).mean(-1),
    )


@eqx.filter_jit
def _luminance(pattern, geometry: PixelGeometry, field: GridField, tracer: NonlinearTracer):
    shift_px = pattern_offset_px(geometry, wall_offset_m(geometry, field, tracer))
    still = sample_pattern(pattern, geometry.cell, geometry.fraction_px) * geometry.weight
    moved = sample_pattern(pattern, geometry.cell, geometry.fraction_px + shift_px) * geometry.weight
    return still, moved
