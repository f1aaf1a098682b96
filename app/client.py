"""A typed client of the service, for notebooks and other programs.

with Client("http://127.0.0.1:8765/#token=...") as airlens:
    job = airlens.submit_job("reconstruct", experiment="20260101T120000-room", settings={"preset": "draft"})
    airlens.wait(job.job)
"""

import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Literal, Self, TypeVar

import httpx
import numpy as np
from jaxtyping import Float
from pydantic import TypeAdapter

from app.api.models.about import About, Health
from app.api.models.answers import (
    AnswersResource,
    CheckResource,
    FoundCamera,
    PortAnswer,
    PortResource,
    TemplateResource,
)
from app.api.models.calibrations import CalibrationResource
from app.api.models.captures import CaptureResource, DeskResource, Role
from app.api.models.devices import CameraResource
from app.api.models.events import EventResource
from app.api.models.experiments import ExperimentLine, ExperimentResource
from app.api.models.guide import GuideResource, StepText
from app.api.models.jobs import Curves, JobResource
from app.api.models.live import LiveResource
from app.api.models.prints import PrintedResource
from app.api.models.problem import MEDIA_TYPE, ProblemDetails
from app.api.models.projector import ProjectorResource, WireLine
from app.api.models.results import ComparisonResource, Form, PresetResource, ResultLine, ResultResource
from app.api.models.rigs import AddressesResource
from app.api.models.screen import PatternName, ScreenResource
from app.api.models.shift import ShiftResource
from app.api.models.together import PlacesResource, TogetherResource
from app.api.models.uploads import Upload
from app.errors import AirlensError, BadInputError
from app.experiment.plan import PlacesLine, Plan
from app.files.durable import write_durably

T = TypeVar("T")
ENDED = ("done", "failed", "cancelled")
Action = Literal["cancel", "pause", "resume", "retry"]


class ServiceError(AirlensError):
    """The service refused or failed; `problem` says why and what to do."""

    def __init__(self, problem: ProblemDetails) -> None:
        super().__init__(problem.detail)
        self.problem = problem


class Client:
    """One service, reached at the address that `airlens serve` prints."""

    def __init__(self, address: str, token: str | None = None, timeout_s: float = 200.0) -> None:
        base, _, fragment = address.partition("#")
        token = token or fragment.removeprefix("token=")
        if not token:
            raise BadInputError(
                "The address holds no token. Give it as `airlens serve` printed it, #token=... included."
            )
        # Only this service is ever asked: no proxy from the environment, no redirect.
        self._http = httpx.Client(
            base_url=base.rstrip("/") + "/api",
            headers={"Authorization": f"Bearer {token}"},
            timeout=timeout_s,
            trust_env=False,
        )

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the connections."""
        self._http.close()

    def health(self) -> Health:
        """Return the service's margins."""
        return self._ask(Health, "GET", "/health")

    def about(self) -> About:
        """Return versions and machine."""
        return self._ask(About, "GET", "/about")

    # Devices

    def devices(self) -> list[CameraResource | ProjectorResource]:
        """List the devices and their states."""
        return self._ask(list[CameraResource | ProjectorResource], "GET", "/devices")

    def camera(self, view: int = 0) -> CameraResource:
        """Return the state of a view's camera, by the view's number."""
        return self._ask(CameraResource, "GET", "/devices/camera", query={"view": str(view)})

    def connect_camera(
        self, experiment: str, air: Literal["still", "moving"] = "still", view: int = 0
    ) -> CameraResource:
        """Connect the camera of a view of an experiment's rig, by the view's number."""
        body = {"experiment": experiment, "air": air, "view": view}
        return self._ask(CameraResource, "POST", "/devices/camera/connect", body)

    def disconnect_camera(self) -> CameraResource:
        """Let the cameras go."""
        return self._ask(CameraResource, "POST", "/devices/camera/disconnect")

    def change_camera(
        self, exposure_s: float | None = None, gain: float | None = None, view: int = 0
    ) -> CameraResource:
        """Set exposure or gain of a view's camera; the answer holds what was granted."""
        body = {"exposure_s": exposure_s, "gain": gain, "view": view}
        return self._ask(CameraResource, "PATCH", "/devices/camera", body)

    def frame(self, stretch: bool = False, view: int = 0) -> bytes:
        """Return one JPEG of what a view's camera sees now."""
        asked = {"stretch": "1" if stretch else "0", "view": str(view)}
        return self._bytes("/devices/camera/frame", asked).content

    def shift(self, view: int = 0) -> ShiftResource:
        """Return how far a view's picture moved since the reference; for the eyes."""
        return self._ask(ShiftResource, "GET", "/devices/camera/shift", query={"view": str(view)})

    def projector(self, view: int = 0) -> ProjectorResource:
        """Return what a projector said when it was last asked, by the number of the first view that sees by it."""
        return self._ask(ProjectorResource, "GET", "/devices/projector", query={"view": str(view)})

    def connect_projector(self, experiment: str, view: int = 0) -> ProjectorResource:
        """Speak to the projector that lights a view of an experiment's rig."""
        body = {"experiment": experiment, "view": view}
        return self._ask(ProjectorResource, "POST", "/devices/projector/connect", body)

    def disconnect_projector(self, view: int = 0) -> ProjectorResource:
        """Free a projector's line."""
        query = {"view": str(view)}
        return self._ask(ProjectorResource, "POST", "/devices/projector/disconnect", query=query)

    def change_projector(
        self,
        power: Literal["on", "off"] | None = None,
        source: str | None = None,
        muted: bool | None = None,
        frozen: bool | None = None,
        view: int = 0,
    ) -> ProjectorResource:
        """Switch power, source, mute or freeze of a view's projector."""
        body = {"power": power, "source": source, "muted": muted, "frozen": frozen, "view": view}
        return self._ask(ProjectorResource, "PATCH", "/devices/projector", body)

    def wire(self, after_s: float = 0.0, view: int = 0) -> list[WireLine]:
        """List what went over a projector's line after a moment (Unix time)."""
        query = {"after_s": str(after_s), "view": str(view)}
        return self._ask(list[WireLine], "GET", "/devices/projector/wire", query=query)

    def screen(self, view: int = 0) -> ScreenResource:
        """Return what the kiosk page of a projector shows, by the number of the first view that sees by it."""
        return self._ask(ScreenResource, "GET", "/devices/screen", query={"view": str(view)})

    def show_pattern(self, experiment: str, pattern: PatternName = "scene", view: int = 0) -> ScreenResource:
        """Put a pattern on the kiosk page of a view's projector."""
        body = {"experiment": experiment, "pattern": pattern, "view": view}
        return self._ask(ScreenResource, "PUT", "/devices/screen", body)

    def clear_screen(self, view: int = 0) -> ScreenResource:
        """Take the pattern away from a kiosk page."""
        return self._ask(ScreenResource, "DELETE", "/devices/screen", query={"view": str(view)})

    def preview_pattern(
        self, experiment: str, pattern: PatternName = "scene", width: int = 480, view: int = 0
    ) -> bytes:
        """Return a pattern of a view's projector as a small PNG."""
        query = {"width": str(width), "view": str(view)}
        return self._bytes(f"/experiments/{experiment}/patterns/{pattern}", query).content

    # Experiments and results

    def experiments(self) -> list[ExperimentLine]:
        """List the experiments, newest first."""
        return self._ask(list[ExperimentLine], "GET", "/experiments")

    def experiment(self, experiment: str) -> ExperimentResource:
        """Return one experiment with its settings."""
        return self._ask(ExperimentResource, "GET", f"/experiments/{experiment}")

    def create_experiment(
        self,
        title: str = "Simulated room",
        camera_px: int = 384,
        light: Literal["texture", "projector"] = "texture",
        boundary: Literal["paper", "operator", "surveyed"] = "surveyed",
    ) -> ExperimentResource:
        """Make an experiment with a simulated rig."""
        body = {
            "kind": "simulated",
            "title": title,
            "camera_px": camera_px,
            "light": light,
            "boundary": boundary,
        }
        return self._ask(ExperimentResource, "POST", "/experiments", body)

    def found_cameras(self) -> list[FoundCamera]:
        """List the cameras that a new experiment may choose from."""
        return self._ask(list[FoundCamera], "GET", "/devices/found")

    def found_picture(self, camera: FoundCamera) -> bytes:
        """Return one JPEG of a camera that was found."""
        query = {
            "kind": camera.kind,
            "device": camera.device,
            "pixel_format": camera.pixel_format,
            "width_px": str(camera.width_px),
            "height_px": str(camera.height_px),
        }
        return self._bytes("/devices/found/picture", query).content

    def ports(self) -> list[PortResource]:
        """List the serial ports."""
        return self._ask(list[PortResource], "GET", "/devices/ports")

    def ask_port(self, device: str) -> PortAnswer:
        """Ask a serial port which projector is there; takes some seconds."""
        return self._ask(PortAnswer, "POST", "/devices/ports/ask", {"device": device})

    def templates(self) -> list[TemplateResource]:
        """List filled-in answers to start from."""
        return self._ask(list[TemplateResource], "GET", "/answers/templates")

    def check_answers(self, answers: Mapping[str, Any], experiment: str | None = None) -> CheckResource:
        """Return every mistake in answers; where there is none, what they make."""
        body = {"answers": dict(answers), "experiment": experiment}
        return self._ask(CheckResource, "POST", "/answers/check", body)

    def create_from_answers(self, answers: Mapping[str, Any]) -> ExperimentResource:
        """Make an experiment for a rig and a room."""
        body = {"answers": dict(answers)}
        return self._ask(ExperimentResource, "POST", "/experiments/from-answers", body)

    def answers(self, experiment: str) -> AnswersResource:
        """Return an experiment's rig and room as answers: as they were entered, else read from its scene."""
        return self._ask(AnswersResource, "GET", f"/experiments/{experiment}/answers")

    def change_answers(
        self, experiment: str, answers: Mapping[str, Any], revision: str | None = None
    ) -> ExperimentResource:
        """Change an experiment's answers; captures and results stay."""
        path, body = f"/experiments/{experiment}/answers", {"answers": dict(answers)}
        return self._ask(ExperimentResource, "PUT", path, body, revision=revision)

    def calibration(self, experiment: str) -> CalibrationResource:
        """Return the calibration in use."""
        return self._ask(CalibrationResource, "GET", f"/experiments/{experiment}/calibration")

    def calibrate(self, experiment: str) -> CalibrationResource:
        """Calibrate a simulated rig."""
        path = f"/experiments/{experiment}/calibration"
        return self._ask(CalibrationResource, "POST", path, {"kind": "simulated"})

    def calibrate_together(self, experiment: str, tape_std_m: float = 0.005) -> TogetherResource:
        """Adjust several calibrated views together, by what more than one of them saw."""
        path = f"/experiments/{experiment}/calibration/together"
        return self._ask(TogetherResource, "POST", path, {"tape_std_m": tape_std_m})

    def places_together(self, experiment: str, places: int = 6) -> PlacesResource:
        """Return which place of a board is wanted before several cameras, and what each found of the newest one."""
        path = f"/experiments/{experiment}/calibration/together"
        return self._ask(PlacesResource, "GET", path, query={"places": str(places)})

    def take_place(self, experiment: str, **how: Any) -> PlacesResource:
        """Take pictures of a board by all cameras at once; `how` are the fields of PlacesRequest."""
        path = f"/experiments/{experiment}/calibration/together/places"
        return self._ask(PlacesResource, "POST", path, how)

    def retake_place(self, experiment: str, place: str) -> PlacesResource:
        """Forget a place of the board."""
        path = f"/experiments/{experiment}/calibration/together/places/{place}"
        return self._ask(PlacesResource, "DELETE", path)

    def skip_place(self, experiment: str, places: int = 6) -> PlacesResource:
        """Do with one place less."""
        path = f"/experiments/{experiment}/calibration/together/skip"
        return self._ask(PlacesResource, "POST", path, {"places": places})

    def stop_place(self, experiment: str) -> PlacesResource:
        """Stop taking pictures; the places that were taken are kept."""
        return self._ask(PlacesResource, "POST", f"/experiments/{experiment}/calibration/together/stop")

    def discard_places(self, experiment: str) -> PlacesResource:
        """Forget all places; the calibration in use stays."""
        return self._ask(PlacesResource, "DELETE", f"/experiments/{experiment}/calibration/together")

    def plan(self, experiment: str) -> Plan:
        """Return the newest plan; a job of kind `plan` makes one."""
        return self._ask(Plan, "GET", f"/experiments/{experiment}/plan")

    def places(self, job: str) -> PlacesLine:
        """Return what a finished job of kind `places` found: the signal from other places of the camera."""
        return self._ask(PlacesLine, "GET", f"/jobs/{job}/places")

    def guide(self, experiment: str, step: StepText = "camera", view: str | None = None) -> GuideResource:
        """Return what a guided calibration wants next, and how good it is; `view` names the camera, of several."""
        path = f"/experiments/{experiment}/calibration/guide"
        return self._ask(GuideResource, "GET", path, query=_of_camera(step, view))

    def take_guided(self, experiment: str, step: StepText = "camera", **how: Any) -> GuideResource:
        """Take the pictures of what is wanted; `how` are the fields of GuideRequest."""
        path = f"/experiments/{experiment}/calibration/guide"
        return self._ask(GuideResource, "POST", path, {"step": step, **how})

    def skip_guided(
        self, experiment: str, step: StepText = "camera", view: str | None = None
    ) -> GuideResource:
        """Do without what is wanted."""
        path = f"/experiments/{experiment}/calibration/guide/skip"
        return self._ask(GuideResource, "POST", path, {"step": step, "view": view})

    def stop_guided(
        self, experiment: str, step: StepText = "camera", view: str | None = None
    ) -> GuideResource:
        """Stop taking pictures; those taken are kept."""
        path = f"/experiments/{experiment}/calibration/guide/stop"
        return self._ask(GuideResource, "POST", path, query=_of_camera(step, view))

    def retake_view(
        self, experiment: str, view: str, step: StepText = "camera", camera: str | None = None
    ) -> GuideResource:
        """Forget a view of the board, so that it is asked for again."""
        path = f"/experiments/{experiment}/calibration/views/{view}"
        return self._ask(GuideResource, "DELETE", path, query=_of_camera(step, camera))

    def discard_guided(
        self, experiment: str, step: StepText = "camera", view: str | None = None
    ) -> GuideResource:
        """Forget what a step has taken and not completed."""
        path = f"/experiments/{experiment}/calibration/guide"
        return self._ask(GuideResource, "DELETE", path, query=_of_camera(step, view))

    def captures(self, experiment: str) -> list[CaptureResource]:
        """List the captures of an experiment."""
        return self._ask(list[CaptureResource], "GET", f"/experiments/{experiment}/captures")

    def capture(self, experiment: str, capture: str) -> CaptureResource:
        """Return one capture."""
        return self._ask(CaptureResource, "GET", f"/experiments/{experiment}/captures/{capture}")

    def start_capture(self, experiment: str, role: Role, frames: int = 100, **settings: Any) -> DeskResource:
        """Begin a capture; `settings` are those of NewCapture."""
        body = {"role": role, "frames": frames, **settings}
        return self._ask(DeskResource, "POST", f"/experiments/{experiment}/captures", body)

    def retake_capture(
        self, experiment: str, capture: str, view: str | None = None, **stated: Any
    ) -> DeskResource:
        """Begin to take one camera's picture of a capture again, alone: `view` by its name, or the missing one.

        `stated` are the ambient temperature and the minutes on, as in `Retake`.
        """
        path = f"/experiments/{experiment}/captures/{capture}/retake"
        return self._ask(DeskResource, "POST", path, {"view": view, **stated})

    def import_captures(
        self,
        experiment: str,
        pictures: Mapping[Role, Sequence[str]],
        bits: int | None = None,
        ambient_temperature_k: float | None = None,
        view: str | None = None,
    ) -> list[CaptureResource]:
        """Make captures of uploaded pictures: the ids of the uploads for each role.

        `view` is the camera that took them, by its name. Of several views a capture waits for those that it names as
        `missing`; `import_views` brings all of them together.
        """
        given = _taken_by(view, pictures)
        body = {"pictures": given, "bits": bits, "ambient_temperature_k": ambient_temperature_k}
        path = f"/experiments/{experiment}/captures/imported"
        return self._ask(list[CaptureResource], "POST", path, body)

    def import_views(
        self,
        experiment: str,
        views: Mapping[str, Mapping[Role, Sequence[str]]],
        bits: int | None = None,
        ambient_temperature_k: float | None = None,
    ) -> list[CaptureResource]:
        """Make captures of uploaded pictures of several cameras in one request: those of each view, by its name."""
        given = [one for view, pictures in views.items() for one in _taken_by(view, pictures)]
        body = {"pictures": given, "bits": bits, "ambient_temperature_k": ambient_temperature_k}
        path = f"/experiments/{experiment}/captures/imported"
        return self._ask(list[CaptureResource], "POST", path, body)

    def prints(self, experiment: str) -> list[PrintedResource]:
        """List what was printed."""
        return self._ask(list[PrintedResource], "GET", f"/experiments/{experiment}/prints")

    def print_pattern(
        self,
        experiment: str,
        paper: str = "a3",
        overlap_m: float = 0.01,
        choose: bool = False,
        view: str | None = None,
    ) -> PrintedResource:
        """Make the PDF of a wall's pattern; `view` names whose, by default the first one's."""
        body = {"paper": paper, "overlap_m": overlap_m, "choose": choose, "view": view}
        return self._ask(PrintedResource, "POST", f"/experiments/{experiment}/prints/pattern", body)

    def print_board(
        self, experiment: str, paper: str = "a3", board: Mapping[str, Any] | None = None
    ) -> PrintedResource:
        """Make the PDF of a board to calibrate with: the fields of BoardGeometry, or the rig's own."""
        body = {"paper": paper, "board": board}
        return self._ask(PrintedResource, "POST", f"/experiments/{experiment}/prints/board", body)

    def read_print(
        self, experiment: str, what: Literal["pattern", "board"], file: Path, view: str | None = None
    ) -> Path:
        """Write the PDF that was made last; of a pattern, for the wall of the view called so."""
        query = None if view is None else {"view": view}
        content = self._bytes(f"/experiments/{experiment}/prints/{what}/pdf", query).content
        write_durably(file, lambda temporary: temporary.write_bytes(content))
        return file

    def running_capture(self) -> DeskResource:
        """Return the capture that is being taken, or the last one."""
        return self._ask(DeskResource, "GET", "/captures/running")

    def live(self) -> LiveResource:
        """Return what is looked at while captures are taken, and what is told of the newest picture of T."""
        return self._ask(LiveResource, "GET", "/captures/live")

    def live_plane(self) -> Float[np.ndarray, "nx nz"] | None:
        """Return the newest picture of T in the middle of the room [K], over x and z; None while there is none."""
        answer = self._bytes("/captures/live/plane")
        return None if answer.status_code == 204 else _unpack(answer)

    def abort_capture(self, discard: bool = False) -> DeskResource:
        """End the running capture within a frame."""
        return self._ask(DeskResource, "POST", "/captures/running/abort", {"discard": discard})

    def annotate_capture(
        self, experiment: str, capture: str, notes: str, revision: str | None = None
    ) -> CaptureResource:
        """Write notes beside a capture; with `revision`, only where nobody else did meanwhile."""
        path = f"/experiments/{experiment}/captures/{capture}"
        return self._ask(CaptureResource, "PATCH", path, {"notes": notes}, revision=revision)

    def discard_capture(self, experiment: str, capture: str) -> None:
        """Remove a capture with everything in it."""
        _check(self._http.delete(f"/experiments/{experiment}/captures/{capture}"))

    def capture_picture(self, experiment: str, capture: str, width: int = 320) -> bytes:
        """Return a small PNG of a capture, for the eyes."""
        path = f"/experiments/{experiment}/captures/{capture}/picture"
        return self._bytes(path, {"width": str(width)}).content

    def capture_image(self, experiment: str, capture: str, view: int = 0) -> Float[np.ndarray, "rows cols"]:
        """Return the mean image of a capture's view, by its number, as fractions of full scale."""
        path = f"/experiments/{experiment}/captures/{capture}/image"
        return _unpack(self._bytes(path, {"encoding": "f32", "view": str(view)}))

    def change_experiment(
        self,
        experiment: str,
        title: str | None = None,
        information: str | None = None,
        board: Mapping[str, Any] | None = None,
        revision: str | None = None,
        marks: Sequence[Mapping[str, Any]] | None = None,
    ) -> ExperimentResource:
        """Change title, notes, the board to calibrate with (the fields of BoardGeometry), or the marks (MarksModel).

        With the `revision` that was read, a change is refused where somebody else changed it meanwhile.
        """
        drawn = None if marks is None else [dict(one) for one in marks]
        body = {"title": title, "information": information, "board": board, "marks": drawn}
        return self._ask(ExperimentResource, "PATCH", f"/experiments/{experiment}", body, revision=revision)

    def addresses(self, experiment: str) -> AddressesResource:
        """List the device files and hosts that an experiment names, and which are confirmed."""
        return self._ask(AddressesResource, "GET", f"/experiments/{experiment}/addresses")

    def confirm_addresses(self, experiment: str, addresses: Sequence[str]) -> AddressesResource:
        """Confirm, once, that an experiment may open these."""
        body = {"addresses": list(addresses)}
        return self._ask(AddressesResource, "PUT", f"/experiments/{experiment}/addresses", body)

    def results(self, experiment: str) -> list[ResultLine]:
        """List the results of an experiment."""
        return self._ask(list[ResultLine], "GET", f"/experiments/{experiment}/results")

    def result(self, experiment: str, result: str) -> ResultResource:
        """Return one result without its numbers."""
        return self._ask(ResultResource, "GET", f"/experiments/{experiment}/results/{result}")

    def volume(self, experiment: str, result: str, field: str) -> Float[np.ndarray, "nx ny nz"]:
        """Return a field as float32, index order [ix, iy, iz]."""
        path = f"/experiments/{experiment}/results/{result}/volumes/{field}"
        return _unpack(self._bytes(path, {"encoding": "f32"}))

    def slice(
        self, experiment: str, result: str, field: str, axis: Literal["x", "y", "z"], index: int
    ) -> Float[np.ndarray, "rows cols"]:
        """Return one plane of a field as float32."""
        path = f"/experiments/{experiment}/results/{result}/slices/{field}"
        return _unpack(self._bytes(path, {"axis": axis, "index": str(index), "encoding": "f32"}))

    def history(self, experiment: str, result: str) -> list[dict[str, float | None]]:
        """Return what was recorded while it was solved."""
        path = f"/experiments/{experiment}/results/{result}/history"
        return self._ask(list[dict[str, float | None]], "GET", path)

    def report(self, experiment: str, result: str) -> str:
        """Return the report as one page of HTML."""
        return self._bytes(f"/experiments/{experiment}/results/{result}/report").text

    def comparison(self, experiment: str, result: str) -> ComparisonResource:
        """Return how a result compares with a simulated room's truth and with point sensors."""
        path = f"/experiments/{experiment}/results/{result}/comparison"
        return self._ask(ComparisonResource, "GET", path)

    def export(
        self,
        experiment: str,
        result: str,
        form: Form,
        file: Path,
    ) -> Path:
        """Write a result as a file for another program."""
        path = f"/experiments/{experiment}/results/{result}/exports/{form}"
        content = self._bytes(path).content
        write_durably(file, lambda temporary: temporary.write_bytes(content))
        return file

    def presets(self) -> list[PresetResource]:
        """List the ways to solve."""
        return self._ask(list[PresetResource], "GET", "/presets")

    # Jobs and events

    def job_kinds(self) -> list[str]:
        """List what a job can compute."""
        return self._ask(list[str], "GET", "/job-kinds")

    def jobs(self, state: str | None = None) -> list[JobResource]:
        """List jobs."""
        return self._ask(list[JobResource], "GET", "/jobs", query={"state": state} if state else None)

    def job(self, job: str) -> JobResource:
        """Return one job."""
        return self._ask(JobResource, "GET", f"/jobs/{job}")

    def submit_job(
        self,
        kind: str,
        settings: dict[str, Any] | None = None,
        experiment: str | None = None,
        title: str = "",
        priority: int = 0,
        key: str | None = None,
    ) -> JobResource:
        """Queue a job."""
        body = {
            "kind": kind,
            "settings": settings or {},
            "experiment": experiment,
            "title": title,
            "priority": priority,
            "key": key,
        }
        return self._ask(JobResource, "POST", "/jobs", body)

    def act_on_job(self, job: str, action: Action) -> JobResource:
        """Cancel, pause, resume or retry a job."""
        return self._ask(JobResource, "POST", f"/jobs/{job}/{action}")

    def order_job(self, job: str, priority: int | None = None, before: str | None = None) -> JobResource:
        """Change where a waiting job stands."""
        return self._ask(JobResource, "PATCH", f"/jobs/{job}", {"priority": priority, "before": before})

    def curves(self, job: str, points: int = 2000) -> Curves:
        """Return what a job told while it ran."""
        return self._ask(Curves, "GET", f"/jobs/{job}/curves", query={"points": str(points)})

    def growing_field(self, job: str) -> Float[np.ndarray, "nx nz"] | None:
        """Return the room's middle plane, T - T0 [K], as a job last showed it; None while there is none."""
        answer = self._bytes(f"/jobs/{job}/field")
        return None if answer.status_code == 204 else _unpack(answer)

    def wait(self, job: str, limit_s: float = 3600.0, every_s: float = 0.5) -> JobResource:
        """Return a job once it ended. Raises TimeoutError after `limit_s`."""
        until_s = time.monotonic() + limit_s
        while (found := self.job(job)).state not in ENDED:
            if time.monotonic() > until_s:
                raise TimeoutError(f"Job {job} is {found.state} after {limit_s:g} s; ask again later.")
            time.sleep(every_s)
        return found

    def events(self, after: int | None = None) -> Iterator[EventResource]:
        """Yield what happens from now on, or since event `after`; without end."""
        headers = {} if after is None else {"Last-Event-ID": str(after)}
        with self._http.stream("GET", "/events", headers=headers, timeout=None) as answer:
            _check(answer)
            for line in answer.iter_lines():
                if line.startswith("data: "):
                    yield EventResource.model_validate_json(line.removeprefix("data: "))

    def past_events(self, after: int = 0, job: str | None = None, limit: int = 500) -> list[EventResource]:
        """List what happened after event `after`, oldest first."""
        query = {"after": str(after), "limit": str(limit)} | ({} if job is None else {"job": job})
        return self._ask(list[EventResource], "GET", "/events/list", query=query)

    # Uploads

    def upload(self, file: Path) -> Upload:
        """Send a PNG, TIFF, NPY or NPZ file."""
        with file.open("rb") as content:
            headers = {"Content-Type": "application/octet-stream"}
            answer = self._http.post("/uploads", content=content, params={"name": file.name}, headers=headers)
        return _read(Upload, answer)

    def uploads(self) -> list[Upload]:
        """List the uploads."""
        return self._ask(list[Upload], "GET", "/uploads")

    def delete_upload(self, upload: str) -> None:
        """Remove an upload."""
        _check(self._http.delete(f"/uploads/{upload}"))

    def _ask(
        self,
        kind: type[T],
        method: str,
        path: str,
        body: Any = None,
        query: dict[str, str] | None = None,
        revision: str | None = None,
    ) -> T:
        headers = {} if revision is None else {"If-Match": f'"{revision}"'}
        return _read(kind, self._http.request(method, path, json=body, params=query, headers=headers))

    def _bytes(self, path: str, query: dict[str, str] | None = None) -> httpx.Response:
        answer = self._http.get(path, params=query)
        _check(answer)
        return answer


def _of_camera(step: StepText, view: str | None) -> dict[str, str]:
    return {"step": step} if view is None else {"step": step, "camera": view}


def _taken_by(view: str | None, pictures: Mapping[Role, Sequence[str]]) -> list[dict[str, Any]]:
    return [{"role": role, "view": view, "uploads": list(uploads)} for role, uploads in pictures.items()]


def _read(kind: type[T], answer: httpx.Response) -> T:
    _check(answer)
    return TypeAdapter(kind).validate_json(answer.content)


def _check(answer: httpx.Response) -> None:
    if answer.is_success:
        return
    answer.read()
    if answer.headers.get("content-type") == MEDIA_TYPE:
        raise ServiceError(ProblemDetails.model_validate_json(answer.content))
    raise AirlensError(f"The service answered {answer.status_code} without an explanation. Is it airlens?")


def _unpack(answer: httpx.Response) -> Float[np.ndarray, "*shape"]:
    shape = tuple(int(part) for part in answer.headers["x-shape"].split(","))
    return np.frombuffer(answer.content, "<f4").reshape(shape).astype(np.float32)
