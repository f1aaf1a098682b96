"""The answer of a report: a few sentences without jargon, and what would make it surer."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from app.errors import explained
from app.experiment.found import Found, found_in
from app.report.doubts import checks, doubts
from app.report.finding import Finding
from app.report.indoor import Quantity
from app.report.indoor import told as line_of
from app.report.meaning import MIXED, beside, category, meaning, warmth
from core.result import Outcome
from core.scene import PointSensors, Wall
from core.significance import EITHER_WAY

# A camera of fewer pixels, or a mean of fewer frames, sees less than a usual one.
_PIXELS, _FRAMES = 2000, 100


def summary(finding: Finding) -> tuple[str, ...]:
    """Three sentences: what the air is like for people, how the room is ventilated, and how sure that is.

    Before them, if there is one, the first reason not to believe them.
    """
    made = [f"Before you believe this: {one}" for one in _doubts_of(finding)[:1]]
    for say in (_people, _ventilation, _sure):
        try:
            made.append(say(finding))
        except Exception as error:  # a result without one of its sentences is still a result
            made.append(f"Not told: {explained(error)}")
    return tuple(made)


def advice(finding: Finding) -> tuple[str, ...]:
    """What to do to know better, the most useful first."""
    return tuple(_advice(finding))


def assumed(manifest: Mapping[str, Any]) -> tuple[str, ...]:
    """What a result took on trust, without what was found before the wall: that has its own place."""
    elsewhere = {one.sentence for one in found_in(manifest)}
    return tuple(sentence for sentence in manifest.get("assumed", ()) if sentence not in elsewhere)


def _people(finding: Finding) -> str:
    figures = {one.key: one for one in finding.indoor.quantities}
    warm = f"Where people are the air is {_value(figures['temperature_mean'], '°C')} on the mean"
    if "speed_mean" not in figures:
        return f"{warm}."
    vote, doubting, draught = figures["pmv"], figures["ppd"], figures["draught_rate_p95"]
    return (
        f"{warm} and moves at {_value(figures['speed_mean'], 'm/s')}: people find it {warmth(vote.value)} "
        f"({line_of(doubting)[1]} are dissatisfied), {category(vote)} of ISO 7730 for warmth, and where draught is "
        f"worst it bothers {_value(draught, '% of them')}, {category(draught)} for draught."
    )


def _ventilation(finding: Finding) -> str:
    figures = {one.key: one for one in finding.indoor.quantities}
    upwards = figures["floor_to_ceiling"]
    higher = f"{abs(upwards.value):.1f} K {'warmer' if upwards.value > 0 else 'colder'}"
    ceiling = f"the ceiling the air is {higher} than at the floor"
    if "speed_mean" not in figures:
        return f"At {ceiling}; its velocity was not found, so nothing is told of draught and ventilation."
    if "air_changes" not in figures:
        return f"At {ceiling}; how its air is changed is not known."
    changes, efficiency = figures["air_changes"], figures["efficiency"]
    changed = f"The supply changes the air {_value(changes, 'times an hour')}"
    return f"{changed} and {ventilates(efficiency)}; at {ceiling}."


def ventilates(efficiency: Quantity) -> str:
    """Better or worse than a mixed room, where its whole interval says so."""
    low, high = (efficiency.value if end is None else end for end in (efficiency.low, efficiency.high))
    mixed = MIXED["efficiency"]
    side = beside(low, high, mixed, "better than", "worse than", "like")
    known = "" if side != "like" else ", as far as can be told"
    return (
        f"ventilates {side} a room that is mixed at once{known} "
        f"(efficiency {_value(efficiency, '%')}, mixed: {mixed:g} %)"
    )


# What a reader looks for first; the rest is in the table.
_TILES = {
    "temperature_mean": "air where people are",
    "speed_mean": "speed there",
    "pmv": "warmth vote (PMV)",
    "draught_rate_p95": "draught rate, 95th percentile",
    "air_changes": "air changes",
    "efficiency": "air change efficiency",
}


@dataclass(frozen=True)
class AtAGlance:
    """One figure to be seen at a glance: its number with its unit, its interval, its name, and what it means."""

    value: str
    interval: str
    name: str
    means: str


def tiles(finding: Finding) -> tuple[AtAGlance, ...]:
    """The figures that a reader looks for first. Raises SettingError for a room without an occupied zone."""
    figures = {one.key: one for one in finding.indoor.quantities}
    made = []
    for key, name in _TILES.items():
        if key in figures:
            _, value, interval = line_of(figures[key])
            made.append(AtAGlance(value, "" if interval == "-" else interval, name, meaning(figures[key])))
    return tuple(made)


def _sure(finding: Finding) -> str:
    """Against the truth where there is one; else by the deviations."""
    solution = finding.solution
    parts = []
    if solution.temperature_std_k is not None:
        parts.append(f"temperature to ± {EITHER_WAY * float(np.nanmedian(solution.temperature_std_k)):.2f} K")
    if solution.velocity_std_m_s is not None:
        spread = np.linalg.norm(np.asarray(solution.velocity_std_m_s), axis=-1)
        parts.append(f"velocity to ± {EITHER_WAY * float(np.nanmedian(spread)):.2f} m/s")
    sure = (
        f"At a usual place these are known: {' and '.join(parts)} (95 %)."
        if parts
        else "It has no intervals."
    )
    if finding.scores is None:
        return f"{sure} There is no truth to compare with; what was taken on trust is listed below."
    # Without the walls' surfaces, which no camera sees: "a usual place" is in the air.
    wrong = f"{finding.scores['T']['air']['rms_K']:.2f} K in the air"
    if finding.scores["u"]:
        wrong += f" and {100 * finding.scores['u']['rel']:.0f} % of the usual speed"
    return f"{sure} This room is simulated, so its truth is known: the answer is wrong by {wrong}."


def _advice(finding: Finding) -> Iterable[str]:
    solution, scene = finding.solution, finding.experiment.settings.scene
    yield from _doubts_of(finding)[1:]
    yield from checks(finding.manifest.get("assumed", ()))
    if solution.outcome in (Outcome.step_limit, Outcome.time_limit, Outcome.nonfinite):
        yield f"The solve did not come to its end. {solution.outcome.value}"
    yield from _unstated(found_in(finding.manifest))
    if solution.velocity_m_s is None:
        yield "Reconstruct with the preset standard: it finds the velocity as well."
    if not any(isinstance(part, PointSensors) for part in scene.boundary):
        yield "Hang two thermometers at two heights: the level of the temperature comes from them."
    unknown = [part.wall for part in scene.boundary if isinstance(part, Wall) and part.thermal == "unknown"]
    if unknown:
        walls = ", ".join(unknown)
        yield f"Measure the walls {walls}, or say that they are insulated: nothing is stated of their heat."
    view = scene.views[0]
    if view.frames < _FRAMES:
        yield f"Average {_FRAMES} frames in each capture instead of {view.frames}: the noise falls with their root."
    if view.camera.width_px < _PIXELS:
        yield f"Take a camera of more than {view.camera.width_px} pixels' width: it sees smaller shifts."
    if finding.experiment.settings.scene.solve.grid != "auto":
        yield (
            f"Solve on a finer grid than {scene.solve.grid} cells (scene.solve.grid, or the preset reference): "
            "a coarse one smears the jet."
        )


def _doubts_of(finding: Finding) -> tuple[str, ...]:
    return doubts(finding.manifest.get("assumed", ()))


def _unstated(things: Sequence[Found]) -> Iterable[str]:
    """What to do about things before the wall that the scene does not state; each is told in its own place."""
    if things:
        many = f"{len(things)} things" if len(things) > 1 else "Something"
        hides, them = ("hide", "them") if len(things) > 1 else ("hides", "it")
        percent = 100 * sum(one.share for one in things)
        yield (
            f"{many} that the scene does not state {hides} {percent:.1f} % of the wall: "
            f"state {them} in experiment.toml, or take {them} away and capture again."
        )


def _value(one: Quantity, unit: str) -> str:
    """A figure with its interval, as people read it."""
    _, value, interval = line_of(one)
    number = value.split(" ")[0]
    between = "" if interval == "-" else f" ({interval.removesuffix(' ' + one.unit).strip()})"
    return f"{number} {unit}{between}"
