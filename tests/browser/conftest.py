"""The operator's page in Debian's Chromium against a real service with the simulated rig."""

import os
import shutil
import threading
from collections.abc import Callable, Generator, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import pytest
from fastapi import FastAPI
from playwright.sync_api import Browser, BrowserContext, Page, Route, expect, sync_playwright
from playwright.sync_api import Error as PlaywrightError

from app.api.factory import create_app
from app.api.security.settings import ServiceConfig, new_token, service_config
from app.api.server import listen, serving
from app.jobs import JobsConfig, Supervisor

CHROMIUM = shutil.which("chromium")
PAGE = Path(__file__).resolve().parents[2] / "web" / "dist" / "index.html"
# As slow as a machine may be: nothing here is a measurement of time.
PATIENCE_MS = 100_000
FLAGS = ["--no-sandbox", "--enable-unsafe-swiftshader", "--force-prefers-reduced-motion"]

expect.set_options(timeout=PATIENCE_MS)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Say why the browser tests do not run where something is missing."""
    reason = None
    if CHROMIUM is None:
        reason = "there is no chromium here; install Debian's package"
    elif not PAGE.is_file():
        reason = "the page is not built; run `python web/hatch_build.py`"
    if reason:
        for item in items:
            if Path(__file__).parent in item.path.parents:
                item.add_marker(pytest.mark.skip(reason=reason))


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(
    item: pytest.Item, call: pytest.CallInfo[None]
) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """Add to the report of a test that failed what its pages showed and complained of."""
    report = yield
    if report.failed and call.when == "call":
        report.sections += [("page", watched.described()) for watched in _WATCHED]
    return report


@dataclass
class Station:
    """A running service with its supervisor, which can be stopped and started again."""

    root: Path
    port: int = 0
    token: str = field(default_factory=new_token)

    @property
    def address(self) -> str:
        return f"http://127.0.0.1:{self.port}/#token={self.token}"

    def start(self) -> None:
        bound = listen("127.0.0.1", self.port)
        self.port = bound.getsockname()[1]
        self.config: ServiceConfig = service_config(self.root, self.token, self.port)
        self.app: FastAPI = create_app(self.config)
        self._serving = serving(self.app, bound)
        self._serving.__enter__()
        self._stop = threading.Event()
        supervisor = Supervisor(self.app.state.services.ledger, JobsConfig())
        self._thread = threading.Thread(target=supervisor.run, args=(self._stop,), daemon=True)
        self._thread.start()

    def stop(self) -> None:
        self._stop.set()
        self._thread.join(timeout=100)
        self._serving.__exit__(None, None, None)


@pytest.fixture(scope="session")
def chromium() -> Iterator[Browser]:
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        yield browser
        browser.close()


@pytest.fixture
def chromium_without_gl(chromium: Browser) -> Iterator[Browser]:
    browser = chromium.browser_type.launch(
        executable_path=CHROMIUM, args=["--no-sandbox", "--disable-gpu", "--disable-3d-apis"]
    )
    yield browser
    browser.close()


@pytest.fixture
def station(tmp_path: Path) -> Iterator[Station]:
    made = Station(tmp_path)
    made.start()
    yield made
    for job in made.app.state.services.ledger.jobs():
        if not job.state.is_finished:
            made.app.state.services.ledger.cancel(job.id)
    made.stop()


@dataclass
class Watched:
    """A page, with everything that it complained of."""

    page: Page
    complaints: list[str]

    def described(self) -> str:
        """Its address, its complaints and its text."""
        try:
            return "\n".join(
                (self.page.url, *self.complaints, self.page.locator("body").inner_text(timeout=2000))
            )
        except PlaywrightError as error:
            return f"It cannot be read: {error}"


# The pages of the test that runs.
_WATCHED: list[Watched] = []
Opens = Callable[..., Watched]


def _with_a_small_camera(route: Route) -> None:
    """A simulated rig that the page makes has a camera that a busy machine can follow."""
    if route.request.method == "POST":
        route.continue_(post_data={**route.request.post_data_json, "camera_px": 384})
    else:
        route.continue_()


@pytest.fixture
def opens(chromium: Browser) -> Iterator[Opens]:
    """Open an address in a fresh context and watch for errors and violations of the policy."""
    contexts: list[BrowserContext] = []

    def open_page(address: str, browser: Browser = chromium, **options) -> Watched:
        context = browser.new_context(**{"viewport": {"width": 1280, "height": 900}} | options)
        contexts.append(context)
        context.set_default_timeout(PATIENCE_MS)
        context.route("**/api/experiments", _with_a_small_camera)
        page = context.new_page()
        complaints: list[str] = []
        page.on(
            "console",
            lambda m: complaints.append(f"{m.text} {m.location['url']}") if m.type == "error" else None,
        )
        page.on("pageerror", lambda error: complaints.append(str(error)))
        watched = Watched(page, complaints)
        _WATCHED.append(watched)
        page.goto(address)
        return watched

    yield open_page
    _WATCHED.clear()
    for context in contexts:
        context.close()


def snapshot(page: Page, name: str) -> None:
    """Keep a screenshot where AIRLENS_SCREENSHOTS says, for somebody to look at."""
    folder = os.environ.get("AIRLENS_SCREENSHOTS")
    if folder:
        page.evaluate("scrollTo(0, 0)")
        page.screenshot(path=str(Path(folder) / f"{name}.png"), full_page=True)
