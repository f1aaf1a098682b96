"""Time and memory of a whole image: python -m tests.benchmarks.render [--columns 4096 --rows 3072].

The paper's placement (camera and projector 29 m away, 1 m apart), a 10 K plume on 64^3 vertices. One JSON
line: CPU seconds of reference and flow (compilation included), peak memory, the largest shift seen, and
the image's error against rays traced through every pixel (a sample of 4000).
"""

import argparse
import json
import resource
import time

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from app.bench.parts.ray_trade import AIR, ROOM
from core.fields import GridField, plume
from core.geometry import looking_along_y
from core.render import pixel_renderer, render_flow, render_reference
from core.scene import ProjectedPattern, Scene, View


def scene(columns: int, rows: int) -> Scene:
    focal_px = columns * 30.5 / 4.1
    middle = ((columns - 1) / 2, (rows - 1) / 2)
    camera = looking_along_y(
        position_m=(0.85, -29.0, 1.5), width_px=columns, height_px=rows, focal_px=focal_px
    )
    lamp = looking_along_y(
        position_m=(1.85, -29.0, 1.5), width_px=columns, height_px=rows, focal_px=focal_px,
        principal_px=(middle[0] + columns / 4.1, middle[1]),
    )  # fmt: skip
    return Scene(room=ROOM, air=AIR, views=(View(camera=camera),), light=ProjectedPattern(projector=lamp))


def field() -> GridField:
    axes = [np.linspace(low, u, 64) for low, u in zip(ROOM.lower_m, ROOM.upper_m, strict=True)]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, 3)
    warm = plume(AIR, peak_k=jnp.asarray(10.0), centre_m=(0.85, 0.0, 1.5), radius_m=0.25)
    values = warm.excess(jnp.asarray(points, jnp.float32)).reshape(64, 64, 64)
    return GridField(ROOM.lower_m, ROOM.upper_m, values)


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--columns", type=int, default=4096)
    parser.add_argument("--rows", type=int, default=3072)
    asked = parser.parse_args()
    world, air = scene(asked.columns, asked.rows), field()
    start = time.process_time()
    reference = render_reference(world)
    middle = time.process_time()
    flow = render_flow(world, air)
    end = time.process_time()
    rng = np.random.default_rng(0)
    pixels = np.stack([rng.integers(0, n, 4000) for n in (asked.columns, asked.rows)], axis=1)
    renderer = pixel_renderer(world, 0, pixels.astype(float), air)
    alone = np.asarray(eqx.filter_jit(lambda r, f: r.flow(f) - r.reference())(renderer, air))
    shared = (flow - reference)[pixels[:, 1], pixels[:, 0]]
    peak_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3
    print(
        json.dumps(
            {
                "columns": asked.columns,
                "rows": asked.rows,
                "reference_cpu_s": round(middle - start, 2),
                "flow_cpu_s": round(end - middle, 2),
                "peak_memory_mb": round(peak_mb),
                "largest_change": float(np.abs(flow - reference).max()),
                "rel_error_of_shared_rays": float(np.linalg.norm(shared - alone) / np.linalg.norm(alone)),
            }
        )
    )


if __name__ == "__main__":
    main()
