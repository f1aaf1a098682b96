"""The plan of an experiment over the service."""

import pytest

from app.client import Client, ServiceError
from app.experiment.plan import (
    PLAN_FILE,
    ChoiceLine,
    MapLine,
    PlacesLine,
    Plan,
    PresetLine,
    SeenLine,
    ViewLine,
)
from app.files.durable import write_json
from app.files.toml import to_plain
from app.plan.promise import source


def a_plan() -> Plan:
    view = ViewLine(
        name="camera", light="texture", window_px=32, noise_px=4e-4, shift_median_px=0.004,
        shift_p90_px=0.008, shift_p99_px=0.011, signal_to_noise=27.0, picture_signal_to_noise=1200.0,
        smallest_visible_k=1.1, frames=100, frames_needed=1.2, other_light="projector",
        other_light_shift_p99_px=0.002,
        map=MapLine(columns_px=[16.0, 48.0], rows_px=[16.0], shift_mpx=[[4.0, None]]),
        places=PlacesLine(
            x_m=[0.5, 1.5], y_m=[1.0], picture_signal_to_noise=[[90.0, None]], signal_to_noise=[[2.0, None]],
            wall_share=[[0.9, None]], camera_m=[1.0, -1.0, 1.2], lower_m=[0.0, 0.0], upper_m=[2.0, 3.0],
        ),
    )  # fmt: skip
    return Plan(
        expected="a plume of 10 K",
        expected_contrast_k=10.0,
        expected_departure_k=0.2,
        views=[view],
        seen=SeenLine(modes=770, modes_seen=230, images=0.5, boundary=0.1, both=0.6),
        choices=[
            ChoiceLine(
                name="steps", value=16, bound=1e-6, limit=4e-5, unit="px", cost_share=0.03, reason="enough"
            )
        ],
        presets=[
            PresetLine(
                preset="draft", fits=True, solver_s=5.0, memory_mb=900.0, temperature_error_k=0.2,
                velocity_error=None, pressure_error=None, reason="",
            )
        ],
        machine="measured",
        verdicts=["camera: seen."],
    )  # fmt: skip


def test_a_kept_plan_comes_back_as_it_was_made(live):
    with Client(f"{live.url}/#token={live.token}") as client:
        made = client.create_experiment(camera_px=64)
        with pytest.raises(ServiceError, match="no plan yet"):
            client.plan(made.experiment)
        write_json(live.config.data_root / "experiments" / made.experiment / PLAN_FILE, to_plain(a_plan()))
        found = client.plan(made.experiment)
        # Where times come from is said as it is now.
        assert found == a_plan().model_copy(update={"machine": source()})


def test_a_contrast_that_cannot_be_is_refused_before_it_is_queued(live):
    with Client(f"{live.url}/#token={live.token}") as client:
        made = client.create_experiment(camera_px=64)
        with pytest.raises(ServiceError, match="excess_k"):
            client.submit_job("plan", experiment=made.experiment, settings={"excess_k": -5.0})
