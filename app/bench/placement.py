"""airlens bench placement: where to put the projector, from what is left of the pattern's motion.

A projector's light bends too, so its pattern moves by the difference of two deflection integrals. This
maps the rms of that difference, as a fraction of a printed texture's, over baselines and stand-offs.
"""

import json
from pathlib import Path
from typing import Annotated

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import typer
from jaxtyping import Float

from app.errors import BadInputError
from core.air import Air
from core.geometry import Box, Optics, looking_along_y
from core.rays.operator import build
from core.scene import FixedTexture, ProjectedPattern, Scene, View

STAND_OFFS_M = (3.5, 4.0, 6.0, 10.0, 30.5)
BASELINES_M = ((0.0, 0.0), (0.5, 0.0), (1.0, 0.0), (2.0, 0.0), (0.0, 0.5), (0.0, 1.0), (0.0, 1.4), (1.0, 1.0))
_WINDOWS = 40


def register(bench: typer.Typer) -> None:
    """Add the command."""

    @bench.command()
    def placement(
        truth: Annotated[Path, typer.Option(help="Room volume (.npz with x, y, z, T, T0).")],
        as_json: Annotated[bool, typer.Option("--json")] = False,
    ) -> None:
        """Share of the signal that a projector-lit wall keeps, by stand-off and baseline."""
        rows = placement_table(truth)
        if as_json:
            typer.echo(json.dumps(rows, indent=1))
            return
        typer.echo("stand-off m  right m  up m  share")
        for row in rows:
            typer.echo(
                f"{row['stand_off_m']:11.1f}  {row['right_m']:7.1f}  {row['up_m']:4.1f}  {row['share']:.2f}"
            )


def placement_table(truth: Path) -> list[dict[str, float]]:
    """One row a stand-off and baseline. Raises BadInputError for a file without the fields."""
    try:
        with np.load(truth) as file:
            axes = [np.asarray(file[k], float) for k in "xyz"]
            excess_k = np.asarray(file["T"], float) - float(file["T0"])
    except (OSError, KeyError, ValueError) as error:
        raise BadInputError(
            f"{truth} is no room volume: {error}. Give an .npz with x, y, z [m], T [K] and T0 [K]."
        ) from error
    room = Box(lower_m=(axes[0][0], axes[1][0], axes[2][0]), upper_m=(axes[0][-1], axes[1][-1], axes[2][-1]))
    return [
        {
            "stand_off_m": off,
            "right_m": right,
            "up_m": up,
            "share": share_left(room, excess_k, off, (right, up)),
        }
        for off in STAND_OFFS_M
        for right, up in BASELINES_M
    ]


def share_left(
    room: Box, excess_k: Float[np.ndarray, "nx ny nz"], stand_off_m: float, baseline_m: tuple[float, float]
) -> float:
    """Rms motion of a projected pattern over that of a printed one, wall layers left out."""
    camera = _optics(room, stand_off_m, (0.0, 0.0))
    projector = _optics(room, stand_off_m, baseline_m)
    centres = _window_centres(camera)
    lit, printed = (
        Scene(room=room, views=(View(camera=camera),), light=light)
        for light in (ProjectedPattern(projector=projector), FixedTexture())
    )
    excess = Air().excess_refractivity(jnp.asarray(excess_k, jnp.float32))
    size = [
        float(np.sqrt(np.mean(np.square(_shift(build(s, 0, centres, excess_k.shape), excess)))))
        for s in (lit, printed)
    ]
    return size[0] / size[1]


@eqx.filter_jit
def _apply(operator: eqx.Module, excess: jnp.ndarray) -> jnp.ndarray:
    return operator.apply(excess)  # type: ignore[attr-defined]


def _shift(operator: eqx.Module, excess: jnp.ndarray) -> np.ndarray:
    return np.asarray(_apply(operator, excess))


def _optics(room: Box, stand_off_m: float, baseline_m: tuple[float, float]) -> Optics:
    """Optics at the room's middle, shifted by the baseline, whose frame sees the whole back wall."""
    x, _, z = room.centre_m
    widest = max(room.size_m[0], room.size_m[2]) + 2 * max(abs(b) for b in baseline_m)
    return looking_along_y(
        position_m=(x + baseline_m[0], room.upper_m[1] - stand_off_m, z + baseline_m[1]),
        width_px=1000,
        height_px=1000,
        focal_px=1000.0 * stand_off_m / widest,
    )


def _window_centres(camera: Optics) -> Float[np.ndarray, "windows 2"]:
    """Windows over the middle nine tenths of the frame."""
    line = np.linspace(0.07, 0.93, _WINDOWS)
    return np.stack(
        np.meshgrid(line * (camera.width_px - 1), line * (camera.height_px - 1)), axis=-1
    ).reshape(-1, 2)
