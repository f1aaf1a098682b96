"""Measures the page in Debian's Chromium (software rendering) against a real service; one JSON line each.

    python -m tests.benchmarks.page_speed

load: packed bytes of the first load and of the room in 3D; live: frames/s of a 1.3 Mpx picture and the age of a frame
when it is on the canvas; room in 3D: frames/s of a 64^3 field with 64 moving streamlines at 960 x 540, and of the
room while it is turned, each frame waited for; curves: 80,000 points told by a job, time to draw an update. Rows:
`results/page_speed.jsonl`.
"""

import argparse
import json
import os
import sqlite3
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
from playwright.sync_api import Locator, Page, sync_playwright

from app.experiment.folder import write_manifest
from app.experiment.results import write_result
from app.jobs import JobSpec
from app.simulate.rehearsal import Rehearsal, rehearse
from core.result import Solution
from drivers.simulated import SimulatedCamera
from tests.browser.conftest import CHROMIUM, FLAGS, Station
from tests.browser.test_page import packed_bytes

POINTS = 80_000
TURNS = 12
FINISH = """canvas => {
  const gl = canvas.getContext("webgl2");
  gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4));
}"""

FINISH_NEXT = f"""async canvas => {{
  await new Promise(requestAnimationFrame);
  ({FINISH})(canvas);
}}"""


def tell(what: str, **numbers: Any) -> None:
    print(json.dumps({"what": what, **numbers, "load_average": round(os.getloadavg()[0], 1)}), flush=True)


def live(page: Page, station: Station, seconds: float) -> None:
    rows, cols = np.mgrid[0:1024, 0:1280].astype(np.float32)
    view = (0.5 + 0.3 * np.sin(rows / 5) * np.sin(cols / 5)).astype(np.float32)
    camera = station.app.state.services.camera
    camera.open(
        station.app.state.services.folders.all()[0].name, lambda: SimulatedCamera(lambda: view, seed=1)
    )
    born: dict[int, float] = {}
    key = -1
    camera.watch(key, lambda frame: born.setdefault(frame.number, time.time()))
    page.reload()
    page.get_by_role("button", name="Rig", exact=True).click()
    canvas = page.locator("canvas.picture")
    canvas.wait_for()
    time.sleep(2)
    ages_s, first, began_s = [], int(canvas.get_attribute("data-frames") or 0), time.monotonic()
    while time.monotonic() - began_s < seconds:
        number, shown_ms = (canvas.get_attribute("data-shown-at") or "0 0").split()
        if int(number) in born:
            ages_s.append(float(shown_ms) / 1000 - born[int(number)])
        time.sleep(0.02)
    last = int(canvas.get_attribute("data-frames") or 0)
    camera.leave(key)
    # What is measured next is measured alone.
    camera.close()
    tell(
        "live",
        frames_per_s=round((last - first) / (time.monotonic() - began_s), 1),
        p50_ms=round(1000 * float(np.percentile(ages_s, 50)), 1),
        p95_ms=round(1000 * float(np.percentile(ages_s, 95)), 1),
    )


def volume(page: Page, seconds: float) -> None:
    page.get_by_role("button", name="Look", exact=True).click()
    place = page.locator(".volume")
    place.evaluate("e => { e.style.width = '960px'; e.style.height = '540px'; }")
    inner = page.locator(".volume > div")
    page.locator(".volume > div[data-moved]").wait_for(state="attached")
    for what in ("plane", "volume"):
        if what == "volume":
            page.get_by_label("Volume", exact=True).check()
            time.sleep(4)
        first, began_s = int(inner.get_attribute("data-moved") or 0), time.monotonic()
        time.sleep(seconds)
        # Reading a pixel waits until everything is really drawn.
        room = page.locator(".volume canvas:not(.strokes)")
        room.evaluate(FINISH)
        last, passed_s = int(inner.get_attribute("data-moved") or 0), time.monotonic() - began_s
        tell("room in 3D", shown=what, edge=64, streamlines=64, width_px=960, height_px=540,
             frames_per_s=round((last - first) / passed_s, 1),
             turned_per_s=round(turned_per_s(page, room), 1))  # fmt: skip


def turned_per_s(page: Page, room: Locator) -> float:
    box = room.bounding_box()
    assert box
    page.mouse.move(box["x"] + 300, box["y"] + 300)
    page.mouse.down()
    began_s = time.monotonic()
    for turn in range(TURNS):
        page.mouse.move(box["x"] + 300 + 10 * turn, box["y"] + 300)
        room.evaluate(FINISH_NEXT)
    passed_s = time.monotonic() - began_s
    page.mouse.up()
    return TURNS / passed_s


def load() -> None:
    tell(
        "load",
        first_bytes=packed_bytes("index.html", "assets/index-*.js", "assets/index-*.css"),
        room_in_3d_bytes=packed_bytes("assets/volume-*.js"),
    )


def curves(page: Page, station: Station) -> None:
    ledger = station.app.state.services.ledger
    job = ledger.submit(JobSpec(kind="noise-study", title="long", settings={"trials": 4, "size_px": 64})).id
    with sqlite3.connect(station.root / "jobs" / "ledger.sqlite") as database:
        body = '{{"step": {0}, "steps": 90000, "loss": {1}}}'
        told = (
            (job, 1, time.time(), "progress", body.format(n, 1 / (n + 1))) for n in range(100, POINTS + 100)
        )
        database.executemany(
            "INSERT INTO events (job_id, attempt, at_s, kind, body) VALUES (?,?,?,?,?)", told
        )
    page.get_by_role("button", name="Reconstruct", exact=True).click()
    page.locator(".chart canvas").wait_for(timeout=60_000)
    times_ms = []
    for step in range(6):
        ledger.append_event("progress", {"step": POINTS + 200 + step, "steps": 90_000, "loss": 0.1}, job=job)
        time.sleep(1.5)
        times_ms.append(float(page.locator(".chart").get_attribute("data-update-ms") or "nan"))
    tell("curves", points=POINTS, update_ms=round(float(np.nanmedian(times_ms)), 1))


def result(station: Station) -> None:
    made = rehearse(station.app.state.services.folders.root, Rehearsal(camera_px=128, world="ideal"))
    axes = [np.linspace(0.0, 3.0, 64)] * 3
    x, y, z = np.meshgrid(*axes, indexing="ij")
    warm = (293 + 5 * np.exp(-((x - 1.5) ** 2 + (y - 1.5) ** 2) - (z - 1) ** 2)).astype(np.float32)
    velocity = np.stack([0.2 * z, 0 * y, 0.1 * x], -1).astype(np.float32)
    folder = made.results_folder / "synthetic"
    folder.mkdir(parents=True)
    write_result(folder / "result.nc", Solution(*axes, temperature_k=warm, velocity_m_s=velocity), {})
    write_manifest(folder, {"preset": "draft"})


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=10.0)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as playwright:
        station = Station(Path(folder))
        station.start()
        result(station)
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        page = browser.new_page(viewport={"width": 1280, "height": 900}, reduced_motion="no-preference")
        load()
        page.goto(station.address)
        live(page, station, options.seconds)
        volume(page, options.seconds)
        curves(page, station)
        browser.close()
        station.stop()


if __name__ == "__main__":
    main()
