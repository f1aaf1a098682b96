"""The report on two pages, to hand on: the answer and the room first; then how it was measured and how sure it is."""

import io
from collections.abc import Iterable
from pathlib import Path
from xml.sax.saxutils import escape

import numpy as np
from matplotlib.figure import Figure
from reportlab.lib import colors
from reportlab.lib.pagesizes import A4
from reportlab.lib.styles import ParagraphStyle
from reportlab.lib.units import mm
from reportlab.pdfgen.canvas import Canvas
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
from app.report.answer import AtAGlance, advice, assumed, summary, tiles
from app.report.beside import places, rows
from app.report.figures import as_png, slices_figure, volume_figure
from app.report.finding import Finding, read_finding
from app.report.indoor import told
from app.report.maps_figure import maps_figure
from app.report.meaning import meaning
from app.report.room_figure import room_figure
from app.report.tables import facts, score_rows
from core.setting import SettingError
from core.significance import EITHER_WAY

# A frame has 6 points of padding on each side.
_WIDTH = A4[0] - 30 * mm - 12
_TEXT = ParagraphStyle("text", fontName="Helvetica", fontSize=8.6, leading=11.2)
_LEAD = ParagraphStyle("lead", parent=_TEXT, fontSize=10, leading=13.5, spaceAfter=3)
_SMALL = ParagraphStyle("small", parent=_TEXT, fontSize=7.2, leading=9, textColor=colors.HexColor("#4a525c"))
_CELL = ParagraphStyle("cell", parent=_TEXT, fontSize=7.6, leading=9.2)
_HEAD = ParagraphStyle(
    "head", parent=_TEXT, fontName="Helvetica-Bold", fontSize=11, leading=14, spaceBefore=5
)
_NUMBER = ParagraphStyle("number", parent=_HEAD, fontSize=12.5, leading=16, spaceBefore=0)
_TITLE = ParagraphStyle("title", parent=_HEAD, fontSize=16, leading=20)
# Of the figures for people and ventilation, those that a page has place for.
_FIGURES = (
    "temperature_mean", "head_to_ankle", "speed_mean", "draught_rate_mean", "draught_rate_p95", "pmv", "ppd", "adpi",
    "air_changes", "mean_age", "efficiency", "zone_index", "supply_temperature", "exhaust_temperature", "heat",
)  # fmt: skip
_NOTES, _ADVICE, _LONGEST = 9, 5, 400

_METHOD = (
    "A camera looks through the air at a patterned wall. Warm air bends light a little less than cold air, so the "
    "pattern moves by hundredths of a pixel between a picture with still air and one with the air moving. {how} "
    "Each figure's interval comes from samples of what the measurements leave open."
)
_MARCHED = (
    "A small flow solver marches the room to a steady state; the measured shifts correct the numbers that nobody "
    "knows exactly."
)
_FITTED = (
    "Temperature, pressure and velocity are fitted to the measured shifts and to the equations of moving air."
)
# How each preset comes from shifts to the air.
_HOW = {
    "draft": "Temperature is fitted to the measured shifts: over the height, and what departs from that. No flow is "
    "computed.",
    "grid": _FITTED,
    "paper": _FITTED,
    "standard": _MARCHED,
    "reference": _MARCHED,
}


def method(preset: str) -> str:
    """How a preset measures the air, in words for a reader of the report; of an unknown one what all share."""
    return _METHOD.format(how=_HOW.get(preset, ""))


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
    foot = f"airlens · {title} · result {finding.name}"
    document.build(
        [first, PageBreak(), second],
        onFirstPage=lambda canvas, _: _foot(canvas, f"{foot} · page 1 of 2"),
        onLaterPages=lambda canvas, _: _foot(canvas, f"{foot} · page 2 of 2"),
    )


def _foot(canvas: Canvas, words: str) -> None:
    """What a page belongs to, below it."""
    canvas.setFont(_SMALL.fontName, _SMALL.fontSize)
    canvas.setFillColor(_SMALL.textColor)
    canvas.drawString(15 * mm + 6, 8 * mm, words)


def _first(finding: Finding, title: str) -> Iterable[Flowable]:
    manifest = finding.manifest
    made = str(manifest.get("created", "")).replace("T", " ")[:16]
    yield _text(title, _TITLE)
    yield _text(f"The air in the room · {made} · preset {manifest.get('preset', 'unknown')}", _SMALL)
    yield Spacer(1, 2 * mm)
    for sentence in summary(finding):
        yield _text(sentence, _LEAD)
    yield Spacer(1, 1 * mm)
    yield from _glance(finding)
    yield Spacer(1, 2 * mm)
    yield from _picture(lambda: room_figure(finding.solution, finding.experiment.settings.scene), 0.68)
    yield from _table(
        ("place", "temperature, 95 %", "true", "speed, 95 %", "true"),
        lambda: rows(places(finding.solution, finding.experiment.settings.scene, finding.truth)),
        (0.38, 0.19, 0.12, 0.19, 0.12),
    )
    yield from _picture(lambda: slices_figure(finding.solution), 0.9)
    yield from _picture(lambda: maps_figure(finding), 1.0)
    yield _text(
        "Planes: temperature and velocity. Maps: seen from above, 1.1 m over the floor, the height of sitting "
        "people's heads; dashed: the zone where people are; A, B and C: where the categories of ISO 7730 end. "
        "Truths are known of simulated rooms only.",
        _SMALL,
    )


def _second(finding: Finding) -> Iterable[Flowable]:
    solution = finding.solution
    yield _text("People and ventilation", _HEAD)
    yield from _table(
        ("quantity", "value", "95 %", "what it means"), lambda: _figures(finding), (0.38, 0.13, 0.2, 0.29)
    )
    yield _text("What to do to know better", _HEAD)
    for sentence in advice(finding)[:_ADVICE]:
        yield _text(f"• {_short(sentence)}", _TEXT)
    yield _text("How sure it is: half of the 95 % interval of temperature, and of velocity", _HEAD)
    deviation, spread = solution.temperature_std_k, solution.velocity_std_m_s
    if deviation is not None:
        yield from _picture(lambda: volume_figure(solution, EITHER_WAY * deviation, "± K (95 %)"), 0.68)
    if spread is not None:
        size = EITHER_WAY * np.linalg.norm(spread, axis=-1)
        yield from _picture(lambda: volume_figure(solution, size, "± m/s (95 %)"), 0.68)
    yield from _table(
        ("against the truth", "error", "trivial answers"), lambda: score_rows(finding), (0.4, 0.12, 0.48)
    )
    yield _text("Method and rig", _HEAD)
    yield _text(method(str(finding.manifest.get("preset"))), _TEXT)
    known = "; ".join(f"{name}: {words}" for name, words in facts(finding.experiment))
    yield _text(_short(known, 3 * _LONGEST, "; "), _SMALL)
    yield _text("What was assumed, and limits", _HEAD)
    told_of = [_short(sentence) for sentence in assumed(finding.manifest)][:_NOTES]
    yield _text(" ".join(told_of), _SMALL)
    yield _text(
        "The air is a mean over the exposure. The report in HTML beside the result has every sentence and the hashes "
        "of every input.",
        _SMALL,
    )


def _glance(finding: Finding) -> Iterable[Flowable]:
    """The figures that a reader looks for first, side by side; nothing where there are none."""
    try:
        made = tiles(finding)
    except SettingError:  # the table says why
        return
    table = Table([[_tile(one) for one in made]], colWidths=[_WIDTH / len(made)] * len(made))
    line = colors.HexColor("#c8ced6")
    table.setStyle(
        TableStyle(
            [
                ("BOX", (0, 0), (-1, -1), 0.6, line),
                ("INNERGRID", (0, 0), (-1, -1), 0.6, line),
                ("VALIGN", (0, 0), (-1, -1), "TOP"),
                ("LEFTPADDING", (0, 0), (-1, -1), 4),
                ("RIGHTPADDING", (0, 0), (-1, -1), 2),
                ("TOPPADDING", (0, 0), (-1, -1), 2),
                ("BOTTOMPADDING", (0, 0), (-1, -1), 4),
            ]
        )
    )
    yield table


def _tile(one: AtAGlance) -> list[Flowable]:
    return [
        _text(one.value, _NUMBER),
        _text(one.interval, _SMALL),
        _text(one.name, _CELL),
        _text(one.means, _SMALL),
    ]


def _figures(finding: Finding) -> list[tuple[str, ...]]:
    by_key = {one.key: one for one in finding.indoor.quantities}
    return [(*told(by_key[key]), meaning(by_key[key])) for key in _FIGURES if key in by_key]


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


def _short(text: str, longest: int = _LONGEST, between: str = ". ") -> str:
    """Of a text that is too long the sentences that have place, and the first one in any case."""
    end = len(text) if len(text) <= longest else text.rfind(between, 0, longest) + 1
    return text[: end or text.find(between) + 1 or len(text)]
