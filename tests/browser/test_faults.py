"""Mishaps in the middle of work: the page says what happened, and the work goes on."""

import os
import re
import signal
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Page, expect

from app.files.durable import write_text
from app.jobs import JobSpec
from app.jobs.folder import read_json
from app.reconstruct.presets import PRESETS
from drivers.projector.escvp21 import EscVp21
from drivers.projector.link import ProjectorLink
from drivers.simulated import CameraFault, SimulatedCamera, VirtualClock
from drivers.simulated.projector.engine import ProjectorFault, SimulatedProjector
from drivers.simulated.projector.escvp21 import EscVp21Twin
from drivers.simulated.projector.hosts import LoopPort
from drivers.simulated.projector.state import TwinState
from tests.app.rig.test_live_camera import SCENE
from tests.browser.conftest import Opens, Station, snapshot


def connected(station: Station, opens: Opens) -> Page:
    """A page with a simulated rig."""
    page = opens(station.address).page
    page.locator("button.next").click()
    expect(page.locator("button.next")).to_have_text("Calibrate")
    return page


def go_to(page: Page, name: str) -> None:
    page.get_by_role("button", name=name, exact=True).first.click()
    expect(page.locator("main")).to_have_attribute("aria-label", name)


def test_a_camera_that_is_unplugged_during_a_burst(station: Station, opens: Opens):
    page = connected(station, opens)
    services = station.app.state.services
    source = services.camera.status.experiment

    def faulty() -> SimulatedCamera:
        return SimulatedCamera(
            lambda: SCENE, seed=1, faults=lambda n: CameraFault.UNPLUG if n == 60 else None
        )

    go_to(page, "Capture")
    services.camera.open(source, faulty)
    page.get_by_role("button", name="Take reference").click()
    desk = page.locator(".desk")
    expect(desk).to_contain_text("incomplete")
    expect(desk).to_contain_text(re.compile(r"device lost.*after \d+ of 100 frames.*kept.*Take it again"))
    expect(page.locator(".library")).to_contain_text("never used as a measurement")
    snapshot(page, "fault-unplugged-in-a-burst")
    page.locator("button.next", has_text="Reconnect the camera").click()
    expect(page.locator("footer")).to_contain_text("camera ready")
    go_to(page, "Capture")
    page.get_by_role("button", name="Take reference").click()
    expect(page.locator(".library")).to_contain_text("100 frames")


def test_a_projector_that_falls_silent(station: Station, opens: Opens):
    page = opens(station.address).page
    expect(page.locator("footer")).to_contain_text("service connected")
    page.get_by_role("button", name="New simulated rig with projector").click()
    connect = page.get_by_role("button", name="Connect projector")
    expect(connect).to_be_visible()
    # Long enough to be seen by whatever machine this is.
    settings = station.app.state.services.folders.all()[0] / "experiment.toml"
    write_text(settings, settings.read_text().replace("warm_up_s=8", "warm_up_s=15"))
    connect.click()
    page.get_by_role("button", name="Lamp on").click()
    footer = page.locator("footer")
    expect(footer).to_contain_text("projector warming")
    expect(page.locator(".projector")).to_contain_text(re.compile(r"warming\s+for \d+ s"))
    expect(footer).to_contain_text("projector on")
    expect(page.locator(".projector")).to_contain_text("steady after about")
    page.get_by_role("button", name="Lamp off").click()
    expect(page.get_by_role("alert")).to_contain_text("The lamp was lit only just now")
    page.get_by_label("Wire log").check()
    expect(page.locator(".wire")).to_contain_text("> PWR ON")
    snapshot(page, "projector-on")
    quiet = [True]
    clock = VirtualClock()
    twin = SimulatedProjector(
        EscVp21Twin(TwinState(clock)), lambda _: ProjectorFault.SILENCE if quiet[0] else None
    )
    services = station.app.state.services
    source = services.projector.report.source
    services.projector.open(source, lambda: ProjectorLink(EscVp21(), LoopPort(twin), clock=clock))
    expect(page.locator(".projector")).to_contain_text(
        "The projector does not answer. Check its power and its cable"
    )
    expect(footer).to_contain_text("projector silent")
    snapshot(page, "fault-projector-silent")
    quiet[0] = False
    expect(footer).to_contain_text("projector standby")


def test_a_worker_that_is_killed_and_a_service_that_is_restarted(station: Station, opens: Opens):
    page = connected(station, opens)
    ledger = station.app.state.services.ledger
    job = ledger.submit(JobSpec(kind="noise-study", settings={"trials": 3000}, title="A long study"))
    go_to(page, "Reconstruct")
    queue = page.locator(".queue")
    expect(queue).to_contain_text("A long study")
    attempts = ledger.folder / job.id / "attempts"
    os.kill(worker_of(attempts / "0001"), signal.SIGKILL)
    expect(queue).to_contain_text("The worker ended without a word")
    snapshot(page, "fault-worker-killed")
    second = worker_of(attempts / "0002")
    station.stop()
    expect(page.locator("footer")).to_contain_text("service not reached")
    go_to(page, "Rig")
    go_to(page, "Reconstruct")
    expect(page.locator("fieldset")).to_contain_text("Reading the presets")
    station.start()
    expect(page.locator("footer")).to_contain_text("service connected")
    expect(page.get_by_role("radio")).to_have_count(len(PRESETS) + 1)
    expect(queue.locator(".light")).to_have_text("done")
    expect(queue).to_contain_text("attempt 2")
    assert read_json(attempts / "0002" / "worker.json")["pid"] == second
    assert not (attempts / "0003").exists()


def worker_of(attempt: Path) -> int:
    """The attempt's process, once it has told of progress."""
    deadline_s = time.monotonic() + 60
    while True:
        told = attempt / "events.jsonl"
        if told.is_file() and '"progress"' in told.read_text():
            return read_json(attempt / "worker.json")["pid"]
        assert time.monotonic() < deadline_s, "no progress"
        time.sleep(0.05)


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    """A file system of its own that can be made to be full without filling it."""
    folder = tmp_path / "disk"
    folder.mkdir()
    made = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", "size=600m", "tmpfs", str(folder)], capture_output=True, check=False
    )
    if made.returncode:
        pytest.skip("a small file system cannot be mounted here")
    yield folder
    subprocess.run(["umount", "-l", str(folder)], check=True)


def resize(disk: Path, size: int) -> None:
    subprocess.run(["mount", "-o", f"remount,size={size}", str(disk)], check=True)


def used_bytes(disk: Path) -> int:
    found = os.statvfs(disk)
    return (found.f_blocks - found.f_bfree) * found.f_frsize


def test_a_disk_that_is_full(small_disk: Path, opens: Opens):
    station = Station(small_disk)
    station.start()
    try:
        page = connected(station, opens)
        resize(small_disk, used_bytes(small_disk) + (4 << 20))
        go_to(page, "Capture")
        page.get_by_role("button", name="Take reference").click()
        expect(page.locator(".desk")).to_contain_text("are held in reserve. Free some")
        snapshot(page, "fault-disk-nearly-full")
        resize(small_disk, used_bytes(small_disk))
        go_to(page, "Rig")
        page.get_by_role("button", name="New simulated rig", exact=True).click()
        alert = page.get_by_role("alert")
        expect(alert).to_contain_text("Free space on the data disk; nothing half-written was kept")
        snapshot(page, "fault-disk-full")
        resize(small_disk, 600 << 20)
        alert.get_by_role("button", name="Dismiss").click()
        go_to(page, "Capture")
        page.get_by_role("button", name="Take reference").click()
        expect(page.locator(".library")).to_contain_text("100 frames")
        assert len(station.app.state.services.folders.all()) == 1
    finally:
        station.stop()
