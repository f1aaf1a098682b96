"""The report on two pages, to hand on: the answer and the room first; then how it was measured and how sure it is."""

import io
from collections.abc import Iterable
from pathlib import Path
from xml.sax.saxutils import escape

from matplotlib.figure import Figure
from reportlab.lib import colors
from reportlab.lib.pagesizes import A4
from reportlab.lib.styles import ParagraphStyle
from reportlab.lib.units import mm
from reportlab.platypus import (
    Flowable,
    Image,
    KeepInFrame,
    PageBreak,
    Paragraph,
    SimpleDocTemplate,
    Spacer,
    Table,
    TableStyle,
)

from app.errors import explained
from app.experiment.folder import open_experiment
from app.report.answer import advice, assumed, summary
from app.report.beside import places, rows
from app.report.figures import as_png, slices_figure, volume_figure
from app.report.finding import Finding, read_finding
from app.report.indoor import told
from app.report.maps_figure import maps_figure
from app.report.room_figure import room_figure
from app.report.tables import facts, score_rows

# A frame has 6 points of padding on each side.
_WIDTH = A4[0] - 30 * mm - 12
_TEXT = ParagraphStyle("text", fontName="Helvetica", fontSize=8.6, leading=11.2)
_LEAD = ParagraphStyle("lead", parent=_TEXT, fontSize=10, leading=13.5, spaceAfter=3)
_SMALL = ParagraphStyle("small", parent=_TEXT, fontSize=7.2, leading=9, textColor=colors.HexColor("#4a525c"))
_CELL = ParagraphStyle("cell", parent=_TEXT, fontSize=7.6, leading=9.2)
_HEAD = ParagraphStyle(
    "head", parent=_TEXT, fontName="Helvetica-Bold", fontSize=11, leading=14, spaceBefore=5
)
_TITLE = ParagraphStyle("title", parent=_HEAD, fontSize=16, leading=20)
# Of the figures for people and ventilation, those that a page has place for.
_FIGURES = (
    "temperature_mean", "head_to_ankle", "speed_mean", "draught_rate_mean", "draught_rate_p95", "pmv", "ppd", "adpi",
    "air_changes", "mean_age", "efficiency", "zone_index", "supply_temperature", "exhaust_temperature", "heat",
)  # fmt: skip
_NOTES, _ADVICE, _LONGEST = 9, 5, 400

_METHOD = (
    "A camera looks through the air at a patterned wall. Warm air bends light a little less than cold air, so the "
    "pattern moves by hundredths of a pixel between a picture with still air and one with the air moving. A small "
    "flow solver marches the room to a steady state; the measured shifts correct the numbers that nobody knows "
    "exactly. Each figure's interval comes from samples of what the measurements leave open."
)


def report_pdf(folder: Path, result: Path, path: Path) -> None:
    """Write the report of a kept result. Raises BadInputError for a result that cannot be read."""
    write_pdf(read_finding(open_experiment(folder), result), path)


def write_pdf(finding: Finding, path: Path) -> None:
    """Write two pages of A4."""
    title = finding.experiment.settings.title or finding.experiment.folder.name
    document = SimpleDocTemplate(
        str(path), pagesize=A4, leftMargin=15 * mm, rightMargin=15 * mm, topMargin=13 * mm, bottomMargin=12 * mm,
        title=f"{title}: the air", author="airlens",
    )  # fmt: skip
    # What is too much for its page is drawn smaller.
    width, height = document.width - 12, document.height - 14
    first, second = (
        KeepInFrame(width, height, list(page), mode="shrink")
        for page in (_first(finding, title), _second(finding))
    )
    document.build([first, PageBreak(), second])


def _first(finding: Finding, title: str) -> Iterable[Flowable]:
    manifest = finding.manifest
    made = str(manifest.get("created", "")).replace("T", " ")[:16]
    yield _text(title, _TITLE)
    yield _text(f"{made} · {manifest.get('preset', '')} · {finding.name} · airlens", _SMALL)
    yield Spacer(1, 2 * mm)
    for sentence in summary(finding):
        yield _text(sentence, _LEAD)
    yield from _picture(lambda: room_figure(finding.solution, finding.experiment.settings.scene), 0.98)
    yield from _table(
        ("place", "temperature, 95 %", "true", "speed, 95 %", "true"),
        lambda: rows(places(finding.solution, finding.experiment.settings.scene, finding.truth)),
        (0.38, 0.19, 0.12, 0.19, 0.12),
    )
    yield from _picture(lambda: maps_figure(finding), 1.0)
    yield _text(
        "Maps seen from above, 1.1 m over the floor, the height of sitting people's heads. Truths are known of "
        "simulated rooms only.",
        _SMALL,
    )


def _second(finding: Finding) -> Iterable[Flowable]:
    solution = finding.solution
    yield _text("People and ventilation", _HEAD)
    yield from _table(("quantity", "value", "95 %"), lambda: _figures(finding), (0.5, 0.2, 0.3))
    yield _text("How sure it is", _HEAD)
    yield from _picture(lambda: slices_figure(solution), 0.66)
    if solution.temperature_std_k is not None:
        deviation = solution.temperature_std_k
        yield from _picture(lambda: volume_figure(solution, deviation, "one sigma of T [K]"), 0.66)
    yield from _table(
        ("quantity", "error", "trivial answers"), lambda: score_rows(finding), (0.4, 0.15, 0.45)
    )
    yield _text("What to do to know better", _HEAD)
    for sentence in advice(finding)[:_ADVICE]:
        yield _text(f"• {_short(sentence)}", _TEXT)
    yield _text("Method and rig", _HEAD)
    yield _text(_METHOD, _TEXT)
    known = "; ".join(f"{name}: {words}" for name, words in facts(finding.experiment))
    yield _text(_short(known, 3 * _LONGEST), _SMALL)
    yield _text("What was assumed, and limits", _HEAD)
    told_of = [_short(sentence) for sentence in assumed(finding.manifest)][:_NOTES]
    yield _text(" ".join(told_of), _SMALL)
    yield _text(
        "The air is a mean over the exposure. The report in HTML beside the result has every sentence and the hashes "
        "of every input.",
        _SMALL,
    )


def _figures(finding: Finding) -> list[tuple[str, ...]]:
    by_key = {one.key: one for one in finding.indoor.quantities}
    return [told(by_key[key]) for key in _FIGURES if key in by_key]


def _text(words: str, style: ParagraphStyle) -> Paragraph:
    return Paragraph(escape(words), style)


def _picture(make, share: float) -> Iterable[Flowable]:
    """A figure over this share of the width, or why there is none."""
    try:
        figure: Figure = make()
        content = as_png(figure, dpi=160)
    except Exception as error:  # no picture may cost the report
        yield _text(f"Not drawn: {explained(error)}", _SMALL)
        return
    width_in, height_in = figure.get_size_inches()
    width = share * _WIDTH
    yield Image(io.BytesIO(content), width, width * height_in / width_in)


def _table(heads: tuple[str, ...], make, shares: tuple[float, ...]) -> Iterable[Flowable]:
    """A table, nothing where it has no rows, or why there is none."""
    try:
        made = list(make())
    except Exception as error:  # no table may cost the report
        yield _text(f"Not listed: {explained(error)}", _SMALL)
        return
    if not made:
        return
    cells = [[_text(cell, _CELL) for cell in row] for row in [heads, *made]]
    table = Table(cells, colWidths=[share * _WIDTH for share in shares])
    line = colors.HexColor("#c8ced6")
    table.setStyle(
        TableStyle(
            [
                ("LINEBELOW", (0, 0), (-1, -1), 0.4, line),
                ("BACKGROUND", (0, 0), (-1, 0), colors.HexColor("#eef1f4")),
                ("TOPPADDING", (0, 0), (-1, -1), 1.4),
                ("BOTTOMPADDING", (0, 0), (-1, -1), 1.8),
            ]
        )
    )
    yield table
    yield Spacer(1, 1.5 * mm)


def _short(sentence: str, longest: int = _LONGEST) -> str:
    return sentence if len(sentence) <= longest else sentence[: longest - 1].rstrip() + "…"
