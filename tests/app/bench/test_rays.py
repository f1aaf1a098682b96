import json

from typer.testing import CliRunner

from app.bench.parts import ray_trade
from app.cli import create_cli


def test_bench_rays_prints_one_json_object_a_row_with_its_error(monkeypatch):
    # Few rays: the claim is about the record, the figures come from a run by hand.
    monkeypatch.setattr(ray_trade, "_ERROR_RAYS", 20)
    monkeypatch.setattr(ray_trade, "_MEMORY_RAYS", 100)
    monkeypatch.setitem(ray_trade.FIELDS, "plume", (ray_trade.FIELDS["plume"][0], 50))

    rows = [r.as_dict() for r in ray_trade.ray_rows(("plume",), (10.0,), (30.0,), (64,))]

    assert [r["tracer"] for r in rows] == ["straight", "quasi_linear", "nonlinear"]
    assert set(json.loads(json.dumps(rows[2]))) == {
        "field", "tracer", "dT_K", "stand_off_m", "steps", "dtype", "rel_error",
        "forward_rays_per_s", "gradient_rays_per_s", "peak_memory_mb",
    }  # fmt: skip
    assert rows[2]["rel_error"] < 1e-6
    assert rows[0]["rel_error"] > rows[2]["rel_error"]


def test_bench_rays_is_on_the_command_line():
    shown = CliRunner().invoke(create_cli(), ["bench", "rays", "--help"])

    assert shown.exit_code == 0
    assert "yardstick" in shown.stdout or "float64" in shown.stdout
