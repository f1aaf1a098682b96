"""Options that several benchmarks share, and the network that they name."""

from pathlib import Path
from typing import Annotated

import typer

from core.mlp import MlpSettings
from core.solve.loop import LoopSettings
from core.solve.network.mlp import MlpSolveSettings

Volume = Annotated[Path, typer.Argument(help="Room volume (NPZ) that is the truth.")]
Out = Annotated[Path, typer.Option(help="Folder for the JSON lines and the pictures.")]
Information = Annotated[str, typer.Option(help="paper, operator or surveyed.")]
Layers = Annotated[int, typer.Option(help="Hidden layers of the network.")]
Width = Annotated[int, typer.Option(help="Width of a layer of the network.")]
Batch = Annotated[int, typer.Option(help="Collocation points a step; the paper's is 8192.")]
AsJson = Annotated[bool, typer.Option("--json", help="One JSON line a row.")]

_PAPER = MlpSolveSettings()


def network(
    regime: str, layers: int, width: int, batch: int, loop: LoopSettings, rays: str = "grid"
) -> MlpSolveSettings:
    """The paper's recipe with this network; its three mini-batches shrink together."""
    share = batch / _PAPER.collocation_points
    return MlpSolveSettings(
        regime=regime,  # type: ignore[arg-type]
        network=MlpSettings(hidden_layers=layers, width=width),
        rays=rays,  # type: ignore[arg-type]
        collocation_points=batch,
        pixels=round(_PAPER.pixels * share),
        boundary_points=round(_PAPER.boundary_points * share),
        loop=loop,
    )
