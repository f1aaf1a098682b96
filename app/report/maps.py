"""What a found air means for people at every vertex: draught, warmth and age of the air, each with its interval.

Draught, PMV and PPD of a place follow from T and u there. They are worked out again for draws from the deviations of
that place, T and the components of u apart, as `core.field_samples` takes them; how places go together does not
matter for one place. The age of the air depends on the whole flow: it is worked out again for whole samples of it.
"""

from dataclasses import replace

import numpy as np
from jaxtyping import Bool, Float
from scipy.interpolate import RegularGridInterpolator
from scipy.special import ndtri

from app.report.indoor import LENGTH_SHARE, SAMPLE_CELLS, age_of_air
from core.comfort import (
    Occupant,
    draught_rate_percent,
    predicted_dissatisfied_percent,
    predicted_mean_vote,
)
from core.field_samples import samples
from core.result import Derived, Solution
from core.scene import Scene
from core.setting import SettingError
from core.ventilation.face_flow import SLOWEST_S

# Draws of a place, a power of two; samples of the whole flow for the age.
_DRAWS_LOG2, _FLOWS = 6, 16
# Intervals are worked out on at most so many vertices an axis, and interpolated between them.
_VERTICES = 24

Volume = Float[np.ndarray, "nx ny nz"]
Axes = tuple[np.ndarray, np.ndarray, np.ndarray]
Maps = dict[str, np.ndarray]

_LABELS = {
    "speed": ("m s-1", "speed of the air"),
    "draught_rate": ("%", "share of people bothered by draught"),
    "pmv": ("1", "predicted mean vote (-3 cold, 3 hot)"),
    "ppd": ("%", "share of people dissatisfied with the warmth"),
    "age": ("min", "age of the air"),
}


def derived_maps(solution: Solution, scene: Scene, occupant: Occupant = Occupant()) -> tuple[Derived, ...]:
    """The maps of a result; none without velocity, and no age where no air passes the walls."""
    if solution.velocity_m_s is None:
        return ()
    air, solution = solution.air, solution.filled()
    made = _of_places(solution, occupant)
    try:
        made["age"] = _age(solution, scene)
    except SettingError:  # `indoor` says why
        pass
    return tuple(
        Derived(name, *_LABELS[name], np.where(air, values, np.nan), *(_of_air(end, air) for end in ends))
        for name, (values, *ends) in made.items()
    )


def _of_air(end: Volume | None, air: Bool[np.ndarray, "nx ny nz"]) -> Volume | None:
    return None if end is None else np.where(air, end, np.nan)


def _of_places(
    solution: Solution, occupant: Occupant
) -> dict[str, tuple[Volume, Volume | None, Volume | None]]:
    """Each map's found values, and the ends of its interval where T or u has a deviation."""
    # Imported here: it takes half a second, and most commands draw no maps.
    from scipy.stats import qmc

    velocity = np.asarray(solution.velocity_m_s, np.float64)
    found = _felt(np.asarray(solution.temperature_k, np.float64), velocity, occupant)
    if solution.temperature_std_k is None or solution.velocity_std_m_s is None:
        return {name: (values, None, None) for name, values in found.items()}
    thin = tuple(
        np.unique(np.linspace(0, n - 1, min(n, _VERTICES)).round().astype(int)) for n in velocity.shape[:3]
    )
    at = np.ix_(*thin)
    kelvin, kelvin_std = solution.temperature_k[at], solution.temperature_std_k[at]
    speed_std = solution.velocity_std_m_s[at]
    drawn: dict[str, list[np.ndarray]] = {name: [] for name in found}
    for draw in ndtri(qmc.Sobol(4, rng=np.random.default_rng(0)).random_base2(_DRAWS_LOG2)):
        felt = _felt(kelvin + draw[0] * kelvin_std, velocity[at] + draw[1:] * speed_std, occupant)
        for name, values in felt.items():
            drawn[name].append(values)
    axes: Axes = (solution.x_m, solution.y_m, solution.z_m)
    places: Axes = tuple(axis[few] for axis, few in zip(axes, thin, strict=True))  # pyright: ignore[reportAssignmentType]
    made = {}
    for name, values in found.items():
        low, high = ends(values[at], np.stack(drawn[name]))
        below, above = (on(places, axes, apart) for apart in (values[at] - low, high - values[at]))
        made[name] = (values, *_bounded(name, values - below, values + above))
    return made


def _felt(kelvin: Volume, velocity_m_s: np.ndarray, occupant: Occupant) -> Maps:
    speed = np.linalg.norm(velocity_m_s, axis=-1)
    vote = predicted_mean_vote(kelvin, speed, occupant)
    return {
        "speed": speed,
        "draught_rate": draught_rate_percent(kelvin, speed),
        "pmv": vote,
        "ppd": predicted_dissatisfied_percent(vote),
    }


def _age(solution: Solution, scene: Scene) -> tuple[Volume, Volume | None, Volume | None]:
    """The age in minutes; samples differ from it as they do on their own, larger cells."""
    axes: Axes = (solution.x_m, solution.y_m, solution.z_m)

    def minutes(air: Solution, cells: int | None = None) -> Volume:
        change = age_of_air(air, scene) if cells is None else age_of_air(air, scene, cells)
        middles = tuple(0.5 * (edges[1:] + edges[:-1]) for edges in change.flow.axes_m)
        return on(middles, axes, change.age_s / 60.0)  # pyright: ignore[reportArgumentType]

    found = minutes(solution)
    if solution.velocity_std_m_s is None:
        return found, None, None
    length_m = LENGTH_SHARE * float(np.prod(scene.room.size_m)) ** (1 / 3)
    coarse = minutes(solution, SAMPLE_CELLS)
    still = replace(solution, temperature_std_k=None)

    def sampled(air: Solution) -> Volume:
        try:
            return minutes(air, SAMPLE_CELLS)
        except SettingError:  # a sample that hardly changes the air: as old as air can be told
            return np.full(found.shape, SLOWEST_S / 60.0)

    ratios = [sampled(air) / coarse for air in samples(still, _FLOWS, length_m)]
    low, high = ends(np.ones_like(found), np.stack(ratios))
    return found, *_bounded("age", found * low, found * high)


def ends(found: np.ndarray, drawn: Float[np.ndarray, "draws ..."]) -> tuple[np.ndarray, np.ndarray]:
    """95 % of the draws, and of the same draws moved so that their median is the found value."""
    low, median, high = np.percentile(drawn, [2.5, 50.0, 97.5], axis=0)
    return np.minimum(low, found + low - median), np.maximum(high, found + high - median)


def on(places: Axes, axes: Axes, values: Volume) -> Volume:
    """Values at `places`, linear between them and held beyond the last, on the vertices of `axes`."""
    points = [np.clip(axis, own[0], own[-1]) for axis, own in zip(axes, places, strict=True)]
    mesh = np.stack(np.meshgrid(*points, indexing="ij"), axis=-1)
    return RegularGridInterpolator(places, values)(mesh)


# What no value of a map is beyond.
_LIMITS = {"draught_rate": (0.0, 100.0), "ppd": (5.0, 100.0), "speed": (0.0, np.inf), "age": (0.0, np.inf)}


def _bounded(name: str, low: Volume, high: Volume) -> tuple[Volume, Volume]:
    least, most = _LIMITS.get(name, (-np.inf, np.inf))
    return np.maximum(low, least), np.minimum(high, most)
