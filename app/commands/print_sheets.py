"""`airlens print pattern` and `airlens print board`."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from calibration.board_kind import BoardKind

if TYPE_CHECKING:
    from app.experiment.rig_settings import BoardSettings

PaperName = Annotated[str, typer.Option(help="a4, a3, a2, a1, a0, or the width of a roll, such as 841mm.")]
Out = Annotated[Path | None, typer.Option(help="PDF to write; by default in the experiment's print/.")]


def register(cli: typer.Typer) -> None:
    """Add `pattern` and `board`."""
    cli.command()(pattern)
    cli.command()(board)


def pattern(
    experiment: Annotated[Path, typer.Argument(help="Experiment folder.")],
    paper: PaperName = "a3",
    overlap: Annotated[str, typer.Option(help="What neighbouring sheets share.")] = "10mm",
    choose: Annotated[
        bool,
        typer.Option(
            "--choose", help="First give the scene the finest pattern that suits camera and distance."
        ),
    ] = False,
    out: Out = None,
    view: Annotated[
        str | None,
        typer.Option(help="The view whose wall it is for; without it every wall's that is printed."),
    ] = None,
) -> None:
    """Write each wall's printed pattern as a PDF at true scale, in sheets that overlap."""
    from app.calibrate.options import length_m
    from app.errors import BadInputError
    from app.experiment.folder import open_experiment
    from app.experiment.views import printed_walls, view_names

    overlap_m, opened = length_m(overlap, "--overlap"), open_experiment(experiment)
    names = view_names(opened)
    # Where nothing is printed the first one says why.
    wanted = [view] if view else [names[number] for number in printed_walls(opened) or (0,)]
    if out is not None and len(wanted) > 1:
        raise BadInputError(
            f"--out names one file, and {len(wanted)} walls bear a print: say whose with --view, one of "
            f"{', '.join(map(repr, wanted))}."
        )
    for one in wanted:
        _write(experiment, one, paper, overlap_m, choose, out)


def _write(experiment: Path, view: str, paper: str, overlap_m: float, choose: bool, out: Path | None) -> None:
    from rich.progress import Progress

    from app.experiment.folder import open_experiment
    from app.sheets.pattern import choose_pattern, print_pattern

    opened = choose_pattern(experiment, view) if choose else open_experiment(experiment)
    with Progress(transient=True) as progress:
        task = progress.add_task("sheets", total=None)
        path, printed = print_pattern(
            opened,
            paper,
            out,
            overlap_m,
            on_sheet=lambda done, total: progress.update(task, completed=done, total=total),
            view=view,
        )
    rows, cols = printed.sheets
    whose = "" if printed.view is None else f"{printed.view}: "
    typer.echo(
        f"{whose}{path}: {rows * cols} sheets of {printed.paper}, {rows} rows of {cols}, for {printed.width_m:.3f} x "
        f"{printed.height_m:.3f} m of wall; finest period {1e3 * (printed.finest_period_m or 0):.3g} mm, "
        f"{printed.finest_period_camera_px:.2g} camera px. Print at 100 % and hold a ruler to the bar of 100 mm."
    )


def board(
    experiment: Annotated[Path | None, typer.Argument(help="Experiment folder; may be left out.")] = None,
    kind: Annotated[BoardKind | None, typer.Option(help="Kind of board.")] = None,
    grid: Annotated[
        str, typer.Option(help="ChArUco squares, inner corners, or circles: 9x6. The rig's own by default.")
    ] = "",
    square: Annotated[
        str, typer.Option(help="Size of a square, or spacing of circles: 30mm. The largest by default.")
    ] = "",
    marker: Annotated[str, typer.Option(help="Size of a ChArUco marker (0.75 of a square).")] = "",
    dictionary: Annotated[str, typer.Option(help="ChArUco dictionary.")] = "DICT_5X5_250",
    paper: PaperName = "a3",
    out: Out = None,
) -> None:
    """Write a board to calibrate with as a PDF at true scale."""
    from app.experiment.folder import open_experiment
    from app.sheets.board import board_layout, print_board, remember_board

    opened = None if experiment is None else open_experiment(experiment)
    own = None if opened is None else opened.settings.rig.board
    asked = bool(kind or grid or square or marker)
    settings = (
        own if own and not asked else _settings(kind or "charuco", grid, square, marker, dictionary, paper)
    )
    path, _ = print_board(settings, paper, out, opened)
    kept = opened is not None and remember_board(opened, settings)
    rows, cols = board_layout(settings, paper).sheets
    several = "" if rows * cols == 1 else f", {rows * cols} sheets, {rows} rows of {cols}"
    typer.echo(
        f"{path}: {settings.kind} {settings.columns} x {settings.rows}, squares of {1e3 * settings.square_m:g} mm"
        f"{several}. "
        "Print at 100 %, hold a ruler to the bar of 100 mm, and glue it on something flat."
        + (" It is the rig's board now." if kept else "")
    )


def _settings(
    kind: BoardKind, grid: str, square: str, marker: str, dictionary: str, paper: str
) -> "BoardSettings":
    from app.calibrate.options import length_m, size_of
    from app.experiment.rig_settings import BoardSettings
    from app.sheets.board import largest_square_m

    columns, rows = size_of(grid or "9x6", "--grid", "9x6")
    unit = BoardSettings(kind=kind, columns=columns, rows=rows, square_m=1.0, dictionary=dictionary)
    square_m = length_m(square, "--square") if square else largest_square_m(unit, paper)
    marker_m = length_m(marker, "--marker") if marker else None
    return unit.model_copy(update={"square_m": square_m, "marker_m": marker_m})
