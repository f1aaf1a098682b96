"""What a found air means for people and for ventilation: the figures of a ventilation engineer, with intervals.

A result's deviations are sampled as smooth random fields (`core.field_samples`) whose correlation length is a fifth
of the room's edge: in the packaged room, whose truth is known, the errors of T and u go together over about that.
Errors of T that all places share (`Solution.temperature_shared_k`) are drawn for the whole room at once.
Every figure is worked out again for each sample. Its interval reaches over 95 % of the samples, and over the same
samples moved so that their median is the found value: where a deviation is larger than the velocity, every sample is
faster than the found air.
"""

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from app.experiment.folder import open_experiment
from app.experiment.results import read_result
from core.comfort import (
    CELSIUS_K,
    TURBULENCE_INTENSITY,
    Occupant,
    air_diffusion_performance_percent,
    draught_rate_percent,
    predicted_dissatisfied_percent,
    predicted_mean_vote,
)
from core.field_samples import samples
from core.geometry import Vector3
from core.occupied import ANKLE_M, HEAD_M, OccupiedZone, at_height, inside
from core.result import Solution
from core.scene import Inlet, Outlet, Scene
from core.setting import SettingError, check_range
from core.ventilation.air_change import AirChange, air_change, source_effectiveness, zone_share
from core.ventilation.face_flow import FaceFlow, conserved, found_flow
from core.ventilation.jet import TERMINAL_M_S, supply_jet
from core.ventilation.openings import Weights, exchange, opening_patches, outlet_weights
from core.ventilation.tracer import Tracer, eddy_diffusivity_m2_s, tracer

SAMPLES = 32
# Correlation length of the deviations over the cube root of the room's volume.
LENGTH_SHARE = 0.2
# Cells an axis of the age of the air: for the found flow, and for each sample of it.
CELLS, SAMPLE_CELLS = 24, 12
# Vertices of the occupied zone along an axis, at most.
_ZONE_VERTICES = 16

Figures = dict[str, float]


@dataclass(frozen=True)
class IndoorAsked:
    """For whom, where, and how finely; `source_m` is a place whose pollution is to be carried off."""

    occupant: Occupant = field(default_factory=Occupant)
    zone: OccupiedZone = field(default_factory=OccupiedZone)
    source_m: Vector3 | None = None
    samples: int = SAMPLES


@dataclass(frozen=True)
class Quantity:
    """One line of the table; `low` and `high` are the ends of its 95 % interval, None where no deviation is known."""

    key: str
    name: str
    unit: str
    value: float
    low: float | None = None
    high: float | None = None


@dataclass(frozen=True)
class Indoor:
    """The table, what it lacks and why, and what was taken for it."""

    quantities: tuple[Quantity, ...]
    missing: tuple[str, ...]
    notes: tuple[str, ...]


# Key: name and unit.
NAMES: Mapping[str, tuple[str, str]] = {
    "temperature_mean": ("temperature, mean", "°C"),
    "temperature_p95": ("temperature, 95th percentile", "°C"),
    "head_to_ankle": ("head (1.1 m) minus ankle (0.1 m), mean", "K"),
    "head_to_ankle_p95": ("head minus ankle, 95th percentile", "K"),
    "floor_to_ceiling": ("air at the ceiling minus air at the floor (0.1 m off), whole room", "K"),
    "speed_mean": ("speed, mean", "m/s"),
    "speed_p95": ("speed, 95th percentile", "m/s"),
    "draught_rate_mean": ("draught rate, mean", "%"),
    "draught_rate_p95": ("draught rate, 95th percentile", "%"),
    "pmv": ("predicted mean vote (PMV), mean", ""),
    "ppd": ("predicted dissatisfied (PPD), mean", "%"),
    "adpi": ("air diffusion performance (ADPI)", "%"),
    "flow": ("supply air", "m³/h"),
    "air_changes": ("air changes", "1/h"),
    "nominal_time": ("volume over flow", "min"),
    "mean_age": ("age of the air, mean of the room", "min"),
    "efficiency": ("air change efficiency", "%"),
    "zone_index": ("air change index of the occupied zone", ""),
    "source_effectiveness": ("removal of the source's air (1: mixed)", ""),
    "supply_temperature": ("supply air, temperature", "°C"),
    "exhaust_temperature": ("exhaust air, temperature", "°C"),
    "heat": ("heat that the air leaves in the room", "W"),
}
_TOGETHER = " Errors of T that all places share are drawn for the whole room at once."
_BY_AREA = (
    "What leaves by each outlet is not stated: outlets share it by area. The intervals of the exhaust's temperature "
    "and of the heat allow for any other sharing: state each outlet's flow to narrow them."
)
_BY_AGE = ("mean_age", "efficiency", "zone_index", "source_effectiveness")
NO_VELOCITY = (
    "This result has no velocity: draught, PMV, ADPI, air change, heat and throw are not told. "
    "Reconstruct with a preset that finds it: standard."
)


def indoor_of(folder: Path, result: Path | None = None, asked: IndoorAsked = IndoorAsked()) -> Indoor:
    """The figures of an experiment's newest, or the given, result. Raises BadInputError, SettingError."""
    experiment = open_experiment(folder)
    solution = read_result(experiment.result(result) / "result.nc")
    return indoor(solution, experiment.settings.scene, asked)


def indoor(solution: Solution, scene: Scene, asked: IndoorAsked = IndoorAsked()) -> Indoor:
    """The figures of a result. Raises SettingError for a zone or a source that is not in the room."""
    box_m = asked.zone.box(scene.room)
    _check_source(asked, scene)
    missing: list[str] = []
    found = _figures(solution, scene, asked, CELLS, missing.append)
    if solution.velocity_m_s is None:
        missing.append(NO_VELOCITY)
    drawn: list[Figures] = []
    if solution.temperature_std_k is not None or solution.velocity_std_m_s is not None:
        drawn = _sampled(solution, scene, asked, found)
    else:
        missing.append("This result has no deviations: its figures have no intervals.")
    quantities = tuple(
        _quantity(key, value, [d[key] for d in drawn if key in d]) for key, value in found.items()
    )
    return Indoor(quantities, tuple(dict.fromkeys(missing)), tuple(_notes(solution, scene, asked, box_m)))


def told(quantity: Quantity) -> tuple[str, str, str]:
    """A line of the table as text: name, value, 95 % interval."""
    unit = f" {quantity.unit}" if quantity.unit else ""
    if quantity.low is None or quantity.high is None or not quantity.high > quantity.low:
        interval = "-" if quantity.low is None else f"{_digits(quantity.value)}{unit}"
        return quantity.name, _digits(quantity.value) + unit, interval
    places = _places(quantity.value, 0.5 * (quantity.high - quantity.low))
    value, low, high = (
        f"{round(number, places) + 0.0:.{places}f}"
        for number in (quantity.value, quantity.low, quantity.high)
    )
    return quantity.name, value + unit, f"{low} to {high}{unit}"


def _places(value: float, doubt: float) -> int:
    """Decimals worth telling of a number known to +- `doubt`: 3 to 35 of its last unit, and three digits at most."""
    worth, three = -math.floor(math.log10(doubt / 3.5)), 2 - math.floor(math.log10(max(abs(value), doubt)))
    return max(0, min(worth, three))


def _digits(value: float) -> str:
    """Three digits, or whole numbers above a hundred."""
    return f"{value:.0f}" if abs(value) >= 100 else f"{value + 0.0:.3g}"


def age_of_air(solution: Solution, scene: Scene, cells: int = CELLS) -> AirChange:
    """The mean age of the air of a result. Raises SettingError where no flow passes the walls."""
    return air_change(_tracer(found_flow(solution.filled(), opening_patches(scene)), cells))


def _sampled(solution: Solution, scene: Scene, asked: IndoorAsked, found: Figures) -> list[Figures]:
    """The figures of each sample; ages differ from the found one's as they do on their own, larger cells."""
    length_m = LENGTH_SHARE * float(np.prod(scene.room.size_m)) ** (1 / 3)
    coarse = _figures(solution, scene, asked, SAMPLE_CELLS, _ignored)
    drawn, rng = [], np.random.default_rng(0)
    for sample in samples(solution, asked.samples, length_m):
        figures = _figures(sample, scene, asked, SAMPLE_CELLS, _ignored, outlet_weights(scene, rng))
        for key in _BY_AGE:
            if key in figures and key in found and key in coarse:
                figures[key] *= found[key] / coarse[key]
        drawn.append(figures)
    return drawn


def _figures(
    solution: Solution,
    scene: Scene,
    asked: IndoorAsked,
    cells: int,
    lacks: Callable[[str], object],
    outlets: Weights | None = None,
) -> Figures:
    figures = _in_the_zone(solution, scene, asked)
    if solution.velocity_m_s is not None:
        try:
            figures |= _of_the_flow(solution, scene, asked, cells, outlets)
            figures |= _of_the_jets(solution, scene)
        except SettingError as error:
            lacks(str(error))
    return figures


def _in_the_zone(solution: Solution, scene: Scene, asked: IndoorAsked) -> Figures:
    low_m, high_m = asked.zone.box(scene.room)
    axes = (solution.x_m, solution.y_m, solution.z_m)
    there = _thinned(inside(axes, low_m, high_m) & solution.air)
    kelvin = np.asarray(solution.temperature_k[there], np.float64)
    figures = {
        "temperature_mean": float(kelvin.mean()) - CELSIUS_K,
        "temperature_p95": float(np.percentile(kelvin, 95)) - CELSIUS_K,
        **_heights(solution, there),
    }
    if solution.velocity_m_s is not None:
        speed = np.linalg.norm(np.asarray(solution.velocity_m_s[there], np.float64), axis=-1)
        draught = draught_rate_percent(kelvin, speed)
        vote = predicted_mean_vote(kelvin, speed, asked.occupant)
        figures |= {
            "speed_mean": float(speed.mean()),
            "speed_p95": float(np.percentile(speed, 95)),
            "draught_rate_mean": float(draught.mean()),
            "draught_rate_p95": float(np.percentile(draught, 95)),
            "pmv": float(vote.mean()),
            "ppd": float(predicted_dissatisfied_percent(vote).mean()),
            "adpi": air_diffusion_performance_percent(kelvin, speed),
        }
    return figures


def _heights(solution: Solution, there: np.ndarray) -> Figures:
    """Differences between heights: over the zone's footprint, and of the whole room."""
    # Vertices on a wall have its surface's temperature, which is not the air's: that follows from the two before it.
    air_k = np.array(solution.temperature_k)
    for wall, before, farther in ((0, 1, 2), (-1, -2, -3)):
        air_k[:, :, wall] = 2.0 * air_k[:, :, before] - air_k[:, :, farther]
    head, ankle, top = (
        at_height(air_k, solution.z_m, height)
        for height in (HEAD_M, ANKLE_M, solution.z_m[-1] - solution.z_m[0] - ANKLE_M)
    )
    upwards_k = np.asarray(head - ankle, np.float64)[there.any(axis=2)]
    upwards_k = upwards_k[~np.isnan(upwards_k)]
    low_k, high_k = (float(np.nanmean(plane[1:-1, 1:-1].astype(np.float64))) for plane in (ankle, top))
    return {
        "head_to_ankle": float(upwards_k.mean()),
        "head_to_ankle_p95": float(np.percentile(upwards_k, 95)),
        "floor_to_ceiling": high_k - low_k,
    }


def _of_the_flow(
    solution: Solution, scene: Scene, asked: IndoorAsked, cells: int, outlets: Weights | None
) -> Figures:
    solution = solution.filled()
    found = found_flow(solution, opening_patches(scene))
    air = exchange(found, solution.temperature_k, scene, outlets)
    transport = _tracer(found, cells)
    change = air_change(transport)
    share = zone_share(change.flow, *asked.zone.box(scene.room))
    figures = {
        "flow": 3600.0 * air.flow_m3_s,
        "air_changes": 3600.0 / change.nominal_s,
        "nominal_time": change.nominal_s / 60.0,
        "mean_age": change.mean_age_s / 60.0,
        "efficiency": 100.0 * change.efficiency,
        "zone_index": change.index(share),
    }
    if asked.source_m is not None:
        figures["source_effectiveness"] = source_effectiveness(transport, asked.source_m)
    return figures | {
        "supply_temperature": air.supply_k - CELSIUS_K,
        "exhaust_temperature": air.exhaust_k - CELSIUS_K,
        "heat": air.heat_w,
    }


def _tracer(found: FaceFlow, cells: int) -> Tracer:
    flow = conserved(found, cells)
    return tracer(flow, eddy_diffusivity_m2_s(flow.speed_m_s, flow.axes_m))


def _of_the_jets(solution: Solution, scene: Scene) -> Figures:
    figures, solution = {}, solution.filled()
    supplies = [part for part in scene.boundary if isinstance(part, Inlet)]
    for n, inlet in enumerate(supplies, 1):
        jet = supply_jet(solution, inlet)
        figures[f"throw_{n}"] = jet.throw_m
        if np.isfinite(jet.drop_m):
            figures[f"drop_{n}"] = jet.drop_m
    return figures


def _thinned(there: np.ndarray) -> np.ndarray:
    """Of the vertices in the zone, so many an axis as figures need."""
    kept = np.zeros_like(there)
    steps = [
        int(np.ceil(there.any(axis=tuple(b for b in range(3) if b != a)).sum() / _ZONE_VERTICES))
        for a in range(3)
    ]
    first = [int(np.argmax(there.any(axis=tuple(b for b in range(3) if b != a)))) for a in range(3)]
    chosen = tuple(slice(start, None, step) for start, step in zip(first, steps, strict=True))
    kept[chosen] = there[chosen]
    return kept


def _quantity(key: str, value: float, drawn: list[float]) -> Quantity:
    name, unit = NAMES.get(key) or _jet_name(key)
    there = np.array([d for d in drawn if np.isfinite(d)])
    if not len(there) or not np.isfinite(value):
        return Quantity(key, name, unit, value)
    low, median, high = np.percentile(there, [2.5, 50, 97.5])
    if low == high:
        return Quantity(key, name, unit, value)
    ends = min(low, value + low - median), max(high, value + high - median)
    least, most = (-np.inf, np.inf) if key.startswith("drop") else _BOUNDS.get(unit, (-np.inf, np.inf))
    return Quantity(key, name, unit, value, float(max(ends[0], least)), float(min(ends[1], most)))


# No figure of these units is beyond these, but for a drop, which has a sign.
_BOUNDS = {
    "%": (0.0, 100.0),
    "m/s": (0.0, np.inf),
    "m³/h": (0.0, np.inf),
    "1/h": (0.0, np.inf),
    "m": (0.0, np.inf),
}


def _jet_name(key: str) -> tuple[str, str]:
    kind, number = key.split("_")
    told = f"throw to {TERMINAL_M_S:g} m/s" if kind == "throw" else "drop at its throw (below 0: it rises)"
    return f"supply {number}, {told}", "m"


def _notes(
    solution: Solution, scene: Scene, asked: IndoorAsked, box_m: tuple[Vector3, Vector3]
) -> Iterable[str]:
    (x0, y0, z0), (x1, y1, z1) = box_m
    yield (
        f"Occupied zone: {asked.zone.from_walls_m:g} m from the walls, x {x0:g} to {x1:g}, y {y0:g} to {y1:g}, "
        f"z {z0:g} to {z1:g} m."
    )
    if solution.velocity_m_s is not None:
        person = asked.occupant
        yield (
            f"People: {person.clothing_clo:g} clo, {person.activity_met:g} met, "
            f"{100 * person.relative_humidity:g} % relative humidity, and walls as warm as the air beside the person."
        )
        yield (
            f"Speeds are those of the mean flow; turbulence intensity for the draught rate: "
            f"{100 * TURBULENCE_INTENSITY:g} %. The age's tracer is spread by eddies after Chen and Xu (1998)."
        )
        if sum(isinstance(part, Outlet) and part.flow_m3_s is None for part in scene.boundary) > 1:
            yield _BY_AREA
    if solution.temperature_std_k is not None or solution.velocity_std_m_s is not None:
        length_m = LENGTH_SHARE * float(np.prod(scene.room.size_m)) ** (1 / 3)
        yield (
            f"Intervals: 95 %, from {asked.samples} samples of the deviations with a correlation length of "
            f"{length_m:.2g} m."
            f"{_TOGETHER if solution.temperature_shared_k is not None else ''}"
        )


def _check_source(asked: IndoorAsked, scene: Scene) -> None:
    if asked.source_m is not None:
        for name, at, low, high in zip(
            "xyz", asked.source_m, scene.room.lower_m, scene.room.upper_m, strict=True
        ):
            check_range(f"{name} of the source", at, low, high, "m", "Give a point in the room, in metres.")


def _ignored(_: str) -> None: ...
