"""What is said before measuring, against what measuring then finds."""

from dataclasses import replace

import numpy as np
import pytest

from core.air import Air
from core.displacement import measure_shift
from core.plan.choices import resolve
from core.plan.expected import expected_flow
from core.plan.observability import seen
from core.plan.second_light import second_light
from core.plan.shift_noise import shift_noise
from core.plan.signal import signal
from core.plan.verdicts import in_short, offered, verdict
from core.problem import Problem
from core.render import render_flow, render_reference
from core.scene import Inlet, Outlet, Patch, Scene, Wall
from core.setting import SettingError
from tests.core.plan.scenes import WINDOW_PX, bench, named


def known_outlet(edge_m: float = 3.0) -> Outlet:
    patch = Patch(wall="x_min", lower_m=(0.2 * edge_m,) * 2, upper_m=(0.4 * edge_m,) * 2)
    return Outlet(patch=patch, mean_temperature_k=293.15)


def planned(scene: Scene, excess_k: float = 10.0):
    problem = Problem(scene, ())
    flow = expected_flow(problem, excess_k)
    return problem, flow, signal(scene, 0, flow, shift_noise(scene, 0, WINDOW_PX))


@pytest.mark.parametrize(
    ("picture_snr", "words"),
    [(0.3, "does not see the expected air"), (2.1, "weakly"), (12.0, "sees the expected air: ")],
)
def test_the_first_sentence_says_whether_the_picture_as_a_whole_shows_the_air(picture_snr, words):
    assert words in in_short(picture_snr)


def test_the_noise_is_predicted_within_a_fifth():
    scene = bench()
    predicted = shift_noise(scene, 0, WINDOW_PX)
    still = np.clip(render_reference(scene), 0, 1)
    noise, random = scene.views[0].noise, np.random.default_rng(3)

    def mean_frame() -> np.ndarray:
        full = 2**noise.bits - 1
        per_e = (full - noise.dark_counts) / noise.full_well_e
        electrons = np.maximum(still * full - noise.dark_counts, 0) / per_e
        frames = random.poisson(electrons, (scene.views[0].frames, *still.shape)) + noise.read_noise_e * (
            random.standard_normal((scene.views[0].frames, *still.shape))
        )
        return ((np.rint(frames * per_e + noise.dark_counts)) / full).mean(0).astype(np.float32)

    found = np.concatenate(
        [measure_shift(mean_frame(), mean_frame(), 1e-5, WINDOW_PX).displacement_px for _ in range(4)]
    )
    assert predicted.std_px == pytest.approx(tuple(found.std(0)), rel=0.2)


def test_the_signal_is_the_rendered_shift():
    scene = bench()
    _, flow, expected = planned(scene, 200.0)
    reference, moved = render_reference(scene), render_flow(scene, flow.field(scene.air))
    measured = measure_shift(reference, moved, 1e-6, WINDOW_PX)
    at = [int(np.linalg.norm(measured.centres_px - c, axis=1).argmin()) for c in expected.shift.centres_px]
    error = np.linalg.norm(measured.displacement_px[at] - expected.shift.displacement_px)
    assert error < 0.1 * np.linalg.norm(expected.shift.displacement_px)


def test_smallest_visible_difference_is_just_visible():
    scene = bench(frames=50)
    _, _, found = planned(scene, 1.0)
    _, _, there = planned(scene, found.smallest_visible_k)
    assert there.snr == pytest.approx(3.0, rel=0.15)
    assert there.frames_factor == pytest.approx(1.0, rel=0.3)


def test_frames_that_are_asked_for_suffice():
    scene = bench(frames=1)
    _, flow, found = planned(scene, 0.5)
    assert found.snr < 3
    sentence = verdict(scene, 0, flow, found, 0.0)
    assert "cannot see" in sentence
    assert "3 times are needed" in sentence
    frames = int(sentence.split("need ")[1].split(" frames")[0])
    enough = replace(scene, views=(replace(scene.views[0], frames=frames),))
    assert planned(enough, 0.5)[2].snr == pytest.approx(3.0, rel=0.1)


def test_a_projector_in_the_cameras_place_sees_nothing():
    scene = bench(baseline_m=0.0)
    _, flow, found = planned(scene)
    assert found.shift.percentile_px(100) < 1e-6
    assert "exactly no shift" in verdict(scene, 0, flow, found, 1.0)


def test_a_second_projector_is_offered_where_it_finds_more_than_its_frames_would():
    problem, flow, found = planned(bench(baseline_m=1.0, width_px=128))
    determined = seen(problem, flow, (found,))
    light = second_light(problem.scene, flow, found, determined)
    assert light is not None
    # The projector stands 1 m to the right of a camera at x = 1.5 m.
    np.testing.assert_allclose(light.position_m, (0.5, -9.0, 1.5), atol=1e-9)
    assert determined.images < light.twice_the_frames < light.images < 1
    (sentence,) = offered(light)
    assert f"fix to {100 * light.images:.0f} %" in sentence
    # Where the air is seen so well that nothing is left to find, or the wall is printed, nothing is offered.
    assert offered(replace(light, images=light.twice_the_frames)) == []
    assert second_light(bench(width_px=128), flow, found, determined) is None


def test_what_one_view_sees_grows_with_the_light_it_collects():
    dim, bright = bench(frames=1), bench(frames=10_000)
    shares = []
    for scene in (dim, bright):
        scene = replace(scene, boundary=(known_outlet(),))
        problem, flow, found = planned(scene)
        shares.append(seen(problem, flow, (found,)))
    assert shares[0].modes_seen < shares[1].modes_seen < shares[1].modes
    assert 0 < shares[0].images < shares[1].images < shares[1].both < 1


# All ten, and against a sweep: tests/benchmarks/auto_choice.py.
@pytest.mark.parametrize("name", ["a candle on a bench", "an office, projected", "a hall"])
def test_auto_agrees_with_the_dearest_model(name: str):
    scene, excess_k = named(name)
    _, flow, found = planned(scene, excess_k)
    resolution = resolve(scene, flow, (found,))
    for choice in resolution.choices:
        # A bound may stay above its limit only at the dearest setting there is.
        assert choice.holds or choice.cost_share >= 0.5, choice
    rays = resolution.scene.rays
    assert rays.tracer in ("straight", "nonlinear")
    assert isinstance(rays.steps, int)
    # Straight rays through 800 K are wrong by more than this camera's noise; through 5 K by far less.
    assert rays.tracer == ("nonlinear" if excess_k > 100 else "straight")
    assert rays.steps <= 64


def test_a_closure_follows_from_the_numbers():
    patch = Patch(wall="x_min", lower_m=(1.0, 1.0), upper_m=(1.2, 1.2))
    for speed, expected in ((1.0, "k_epsilon"), (0.01, "molecular")):
        inlet = Inlet(patch=patch, temperature_k=293.16, velocity_m_s=(speed, 0.0, 0.0))
        scene = replace(bench(edge_m=1.3, stand_off_m=4.0), boundary=(inlet,))
        _, flow, found = planned(bench(edge_m=1.3, stand_off_m=4.0), 0.01)
        assert resolve(scene, flow, (found,)).scene.flow.transport == expected


def test_supply_and_walls_are_marched():
    inlet = Inlet(
        patch=Patch(wall="x_min", lower_m=(1.2, 2.0), upper_m=(1.8, 2.6)),
        temperature_k=303.15,
        velocity_m_s=(0.5, 0.0, 0.0),
    )
    walls = tuple(Wall(wall=w, thermal="adiabatic") for w in ("y_min", "y_max", "z_min", "z_max", "x_max"))
    scene = replace(bench(), boundary=(inlet, known_outlet(), *walls), air=Air())
    flow = expected_flow(Problem(scene, ()))
    assert "marched" in flow.source
    assert flow.step_s is not None
    assert 0 < flow.step_s < 1
    assert 0 < flow.excess_k.max() <= 10.0 + 1e-3


def test_air_that_leaves_warmer_than_it_came_is_not_cut_to_its_supply():
    inlet = Inlet(
        patch=Patch(wall="x_min", lower_m=(1.2, 2.0), upper_m=(1.8, 2.6)),
        temperature_k=293.65,
        velocity_m_s=(0.5, 0.0, 0.0),
    )
    outlet = replace(known_outlet(), mean_temperature_k=296.15)
    found = expected_flow(Problem(replace(bench(), boundary=(inlet, outlet), air=Air()), ()))
    # Unknown walls warm the air from the supply's 0.5 K towards the 3 K that leave.
    assert 1.0 < found.excess_k.max() <= 3.0 + 1e-3
    assert np.ptp(found.excess_k[1:-1, 1:-1, 15]) > 0.05


@pytest.mark.parametrize("excess_k", [0.0, -3.0, float("nan"), 1e5])
def test_a_contrast_that_cannot_be_is_refused(excess_k: float):
    with pytest.raises(SettingError, match="above 0 and below"):
        expected_flow(Problem(bench(), ()), excess_k)
