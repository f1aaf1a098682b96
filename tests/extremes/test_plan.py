"""Before measuring: what is expected of 1 mK and of 2000 K, of a bench of 1 cm and a camera 1 km away."""

from dataclasses import replace

from core.known import level_of
from core.plan.cost import draft_work, grid_work
from core.plan.expected import expected_flow
from core.plan.shift_noise import shift_noise
from core.plan.signal import signal
from core.plan.verdicts import verdict
from core.problem import Problem
from core.scene import CameraNoise, FixedTexture, Scene
from tests.core.plan.scenes import bench
from tests.extremes.row import Named, Near, Refused, Row, Within, extremes, prove

STAGE = "plan"
WINDOW_PX = 8


def small(**given) -> Scene:
    return bench(width_px=64, **given)


def wide(**given) -> Scene:
    return bench(width_px=2048, frames=100, **given)


def seen(scene: Scene, excess_k: float, window_px: int = WINDOW_PX):
    flow = expected_flow(Problem(scene, ()), excess_k)
    return flow, signal(scene, 0, flow, shift_noise(scene, 0, window_px))


def snr_per_k(name: str, expected, excess_k: float) -> Row:
    """Signal to noise a part of the air's refractivity that goes, against that at 10 K."""

    def per_share(contrast_k: float) -> float:
        ambient_k = small().air.ambient_temperature_k
        return seen(small(), contrast_k)[1].snr / (contrast_k / (ambient_k + contrast_k))

    def run() -> float:
        return per_share(excess_k) / per_share(10.0)

    return Row(STAGE, f"signal over contrast, {name}", run, expected)


def visible(name: str, expected, scene: Scene, excess_k: float = 10.0) -> Row:
    """Smallest visible difference [K]."""
    return Row(
        STAGE, f"smallest visible, {name}", lambda: seen(scene, excess_k)[1].smallest_visible_k, expected
    )


def noise(name: str, expected, scene: Scene, window_px: int = WINDOW_PX) -> Row:
    """Noise of one window against that of 8 px and 4 frames."""

    def run() -> float:
        return shift_noise(scene, 0, window_px).mean_px / shift_noise(small(), 0, WINDOW_PX).mean_px

    return Row(STAGE, f"noise, {name}", run, expected)


def refused(name: str, words: str, run) -> Row:
    return Row(STAGE, name, run, Refused(words))


def said(name: str, words: str, scene: Scene, excess_k: float) -> Row:
    """Whether a verdict says so."""

    def run() -> str:
        flow, found = seen(scene, excess_k)
        return words if words in verdict(scene, 0, flow, found, 0.0) else verdict(scene, 0, flow, found, 0.0)

    return Row(STAGE, f"verdict, {name}", run, Named(words))


def with_view(scene: Scene, **changes) -> Scene:
    return replace(scene, views=(replace(scene.views[0], **changes),))


def plain(scene: Scene) -> Scene:
    """No pattern on the wall."""
    assert isinstance(scene.light, FixedTexture)
    return replace(scene, light=replace(scene.light, pattern=replace(scene.light.pattern, contrast=0.0)))


ROWS = [
    *(snr_per_k(f"{k:g} K", Near(1.0, rel=0.01), k) for k in (0.001, 0.1)),
    # Hot air thins less and less: a plume's core is flat and its flanks are steeper.
    *(snr_per_k(f"{k:g} K", Within(1.0, 1.6), k) for k in (100.0, 2000.0)),
    # A single frame's noise takes 3 % of the information, as noise that passes for texture.
    noise("1 frames", Near(2.0, rel=0.04), small(frames=1)),
    # Where noise is small, how the light curves over a window is fitted with the shift, not taken from what is usual.
    noise("65535 frames", Within((4 / 65_535) ** 0.5, 1.25 * (4 / 65_535) ** 0.5), small(frames=65_535)),
    noise("a full well of 1 e-", Within(1.0, 1e6), with_view(small(), noise=CameraNoise(full_well_e=1.0))),
    noise("a window of 4 px", Within(1.0, 5.0), small(), 4),
    noise("a window of 32 px", Within(0.1, 1.0), small(), 32),
    visible("a bench of 1 cm", Within(1.0, 1e4), wide(edge_m=0.01, stand_off_m=0.04)),
    visible("a hall of 100 m", Within(0.1, 1e3), wide(edge_m=100.0, stand_off_m=200.0)),
    visible("1 km away", Within(0.1, 1e3), wide(stand_off_m=1000.0)),
    visible("a projector 10 m beside", Within(0.1, 1e3), wide(baseline_m=10.0)),
    said("a bench of 1 cm and 64 px", "cannot see", small(edge_m=0.01, stand_off_m=0.04), 10.0),
    said("1 mK", "cannot see", small(), 0.001),
    said("a projector in the camera's place", "exactly no shift", small(baseline_m=0.0), 10.0),
    refused("no contrast", "above 0 and below", lambda: seen(small(), 0.0)),
    refused("a contrast of 10,000 K", "above 0 and below", lambda: seen(small(), 1e4)),
    refused("a contrast that is NaN", "above 0 and below", lambda: seen(small(), float("nan"))),
    refused("a window larger than the picture", "no window", lambda: seen(small(), 10.0, 128)),
    Row(
        STAGE, "level of information, nothing stated", lambda: level_of(Problem(small(), ())), Named("images")
    ),
    Row(STAGE, "work of a grid of 2", lambda: grid_work(_grid(2)).loops, Near(8.0)),
    Row(STAGE, "work of a grid of 512", lambda: grid_work(_grid(512)).loops, Near(512.0**3)),
    Row(STAGE, "work of a draft without windows", lambda: draft_work(_grid(16), 0).loops, Near(0.0)),
]


def _grid(cells: int) -> Problem:
    scene = small()
    return Problem(replace(scene, solve=replace(scene.solve, grid=cells)), ())


@extremes(ROWS)
def test_the_plan_at_its_limits(row: Row, record_property):
    prove(row, record_property)


def test_without_a_pattern_no_heat_is_visible():
    _, found = seen(plain(small()), 10.0)
    assert found.noise.mean_px > 1.0
    assert found.snr < 1e-3
