import numpy as np
import pytest

from core.metrics import score_pressure, score_temperature, score_velocity


@pytest.fixture
def temperature_k():
    rng = np.random.default_rng(0)
    return 300.0 + np.linspace(0, 4, 6)[None, None] + rng.standard_normal((5, 7, 6))


def test_the_truth_scores_zero_and_a_constant_offset_scores_itself(temperature_k):
    assert score_temperature(temperature_k, temperature_k, 293.15)["rms_K"] == 0.0
    assert score_temperature(temperature_k + 0.5, temperature_k, 293.15)["rms_K"] == pytest.approx(0.5)


def test_wall_planes_with_a_layer_inside_the_first_cell_do_not_count(temperature_k):
    wrong = temperature_k.copy()
    wrong[-1], wrong[:, 0], wrong[:, -1] = 0.0, 0.0, 0.0
    assert score_temperature(wrong, temperature_k, 293.15)["rms_K"] == 0.0


def test_the_airs_own_error_leaves_out_what_walls_show(temperature_k):
    wrong = temperature_k + 0.5
    wrong[0], wrong[..., 0], wrong[..., -1] = 0.0, 0.0, 0.0
    scores = score_temperature(wrong, temperature_k, 293.15)
    assert scores["rms_K"] > 10.0
    assert scores["air"]["rms_K"] == pytest.approx(0.5)


def test_the_mean_at_each_height_scores_one_in_departure(temperature_k):
    inner = temperature_k[:-1, 1:-1]
    found = np.broadcast_to(inner.mean(axis=(0, 1)), temperature_k.shape)
    assert score_temperature(found, temperature_k, 293.15)["rel_departure"] == pytest.approx(1.0)


def test_trivial_answers_are_what_they_say(temperature_k):
    trivial = score_temperature(temperature_k, temperature_k, 293.15)["trivial"]
    inner = temperature_k[:-1, 1:-1]
    assert trivial["ambient"] == pytest.approx(np.sqrt(np.mean((inner - 293.15) ** 2)))
    assert trivial["inlet_plane"] == pytest.approx(np.sqrt(np.mean((inner - inner[:1]) ** 2)))


def test_still_air_scores_one_and_the_jet_is_scored_apart():
    u = np.zeros((5, 7, 6, 3))
    u[:3, 2:4, 2:4, 0] = 0.5
    u[..., 2] = 0.01
    scores = score_velocity(np.zeros_like(u), u, 0.5)
    assert scores["rel"] == pytest.approx(1.0)
    assert scores["jet_rel"] == pytest.approx(1.0)
    half = u * np.where(np.linalg.norm(u, axis=-1) > 0.1, 0.5, 1.0)[..., None]
    assert score_velocity(half, u, 0.5)["jet_rel"] == pytest.approx(0.5)
    assert score_velocity(half, u, 0.5)["outside_jet_rel"] == pytest.approx(0.0)


def test_pressure_is_known_up_to_a_constant():
    p = np.random.default_rng(1).standard_normal((5, 7, 6))
    assert score_pressure(p + 3.0, p)["rel"] == pytest.approx(0.0, abs=1e-12)


def test_the_trivial_pressure_is_the_first_planes_carried_along_x():
    p = np.random.default_rng(2).standard_normal((5, 7, 6))
    carried = np.broadcast_to(p[:1], p.shape)
    expected = score_pressure(carried, p)["rel"]
    assert expected > 0.1
    assert score_pressure(p, p)["trivial"]["inlet_plane"] == pytest.approx(expected)
    # A room whose pressure does not change along x is that plane.
    assert score_pressure(carried, carried)["trivial"]["inlet_plane"] == pytest.approx(0.0, abs=1e-12)
