"""`plan`: what this experiment would see and cost, before anybody measures. Kept as plan.json beside it."""

from collections.abc import Callable
from pathlib import Path

import numpy as np

from app.experiment.folder import Experiment, open_experiment
from app.experiment.plan import (
    PLAN_FILE,
    AveragingLine,
    ChoiceLine,
    MapLine,
    PlacesLine,
    Plan,
    PresetLine,
    SecondLightLine,
    SeenLine,
    ViewLine,
)
from app.files.durable import write_json
from app.files.toml import to_plain
from app.plan.acting import acting_choices
from app.plan.machine import this_machine
from app.plan.promise import promise, source
from app.plan.runs import kept_runs
from app.plan.task import pixels_of, scene_of, task_of, work_of
from app.plan.tradeoff import ExpectedError, expected_error
from app.reconstruct.presets import PRESETS
from app.reconstruct.problem import known_of
from core.displacement import resolve_window_px
from core.known import level_of
from core.known_temperature import known_temperature, refuse_without_level
from core.metrics import departure, inner, rms
from core.plan.averaging import Fluctuation
from core.plan.choice import Choice
from core.plan.expected import ExpectedFlow, expected_flow, largest_contrast_k
from core.plan.observability import seen
from core.plan.places import place_map
from core.plan.second_light import SecondLight, second_light
from core.plan.shift_noise import shift_noise
from core.plan.signal import Signal, other_light, shift_map, signal
from core.plan.verdicts import blindness, broken, in_short, moving, offered, verdict
from core.problem import Problem
from core.scene import Scene
from core.setting import SettingError
from core.solve.draft.draft import draft_grid
from core.view_frame import facing, turn_of

OnStage = Callable[[str], object]
# JSON has no infinity.
_LARGEST = 1e30


def plan(folder: Path, *, excess_k: float | None = None, on_stage: OnStage = lambda stage: None) -> Plan:
    """Plan an experiment and keep the plan in it. Raises BadInputError, SettingError."""
    experiment = open_experiment(folder)
    on_stage("read what is known")
    problem = stated_problem(experiment)
    on_stage("march the expected flow coarsely")
    flow = expected_flow(problem, excess_k)
    on_stage("noise and signal of each view")
    signals = signals_of(problem, flow)
    on_stage("what the views determine")
    determined = seen(problem, flow, signals)
    further = second_light(problem.scene, flow, signals[0], determined)
    on_stage("signal from other places of the camera")
    places = [_places(problem, n, flow) for n in range(len(signals))]
    on_stage("judge the choices")
    choices = acting_choices(problem.scene, flow, signals)
    views = [_view_line(problem, n, flow, s, places[n]) for n, s in enumerate(signals)]
    made = Plan(
        scene=scene_of(problem.scene),
        pixels=pixels_of(problem.scene),
        expected=flow.source,
        expected_contrast_k=float(np.abs(flow.excess_k).max()),
        expected_departure_k=departure_k(flow),
        views=views,
        seen=SeenLine(
            modes=determined.modes,
            modes_seen=determined.modes_seen,
            images=determined.images,
            boundary=determined.boundary,
            both=determined.both,
            second_light=None if further is None else _second_light_line(further),
        ),
        averaging=_averaging(flow.fluctuation),
        choices=[_choice_line(choice) for choice in choices],
        presets=preset_lines(problem, flow, excess_k),
        machine=source(),
        verdicts=[
            in_short(max(view.picture_signal_to_noise for view in views)),
            *(
                verdict(problem.scene, n, flow, s, view.other_light_shift_p99_px)
                for n, (s, view) in enumerate(zip(signals, views, strict=True))
            ),
            blindness(determined, [view.name for view in problem.scene.views]),
            *offered(further),
            *moving(flow.fluctuation),
            *broken(choices),
        ],
    )
    write_json(experiment.folder / PLAN_FILE, to_plain(made))
    return made


def stated_problem(experiment: Experiment) -> Problem:
    """The problem without its measurements: scene, planes, sensors."""
    known = known_of(experiment)
    return Problem(known.scene, (), known.planes, known.sensors)


def _second_light_line(found: SecondLight) -> SecondLightLine:
    return SecondLightLine(
        position_m=list(found.position_m), images=found.images, twice_the_frames=found.twice_the_frames
    )


def departure_k(flow: ExpectedFlow) -> float:
    """Rms departure of the expected temperature from the mean at each height, as the score takes it."""
    return rms(departure(inner(flow.excess_k)))


def preset_lines(problem: Problem, flow: ExpectedFlow, excess_k: float | None = None) -> list[PresetLine]:
    """Every preset: time and memory by this machine's figures and runs, errors from the committed rows.

    `excess_k` is the largest contrast where another one than the stated is asked for.
    """
    contrast_k = excess_k or largest_contrast_k(problem) or float(np.abs(flow.excess_k).max())
    return [_preset_line(name, problem, flow, contrast_k) for name in PRESETS]


def _preset_line(name: str, problem: Problem, flow: ExpectedFlow, contrast_k: float) -> PresetLine:
    speeds = this_machine()[0].speeds
    refused = _refused(name, problem, flow)
    fits = refused is None
    known = expected_error(name, level_of(problem), problem.scene.light.kind) if fits else None
    work = work_of(name, problem, flow)
    task = task_of(name, problem, None if work is None else work.loops)
    promised = promise(task, kept_runs(), speeds)
    return PresetLine(
        preset=name,
        fits=fits,
        wall_s=promised.wall_s if fits else None,
        solver_s=promised.solver_s if fits else None,
        compiled=promised.warm,
        work=task.work,
        programs=task.programs,
        memory_mb=speeds[name].megabytes(work) if work is not None and name in speeds else None,
        temperature_error_k=known.temperature * contrast_k if known else None,
        velocity_error=known.velocity if known else None,
        pressure_error=known.pressure if known else None,
        reason=refused or _preset_reason(known, contrast_k),
    )


def _refused(name: str, problem: Problem, flow: ExpectedFlow) -> str | None:
    """Why a preset would not solve the problem; None where it would."""
    if name in ("standard", "reference") and flow.step_s is None:
        return (
            "needs what drives the air: an inlet or a heater in the scene, or a plane that shows all openings"
        )
    if name == "draft":
        try:
            refuse_without_level(known_temperature(problem, draft_grid(problem.scene)))
        except SettingError as refusal:
            return str(refusal)
    return None


def _preset_reason(known: ExpectedError | None, contrast_k: float) -> str:
    if known is None:
        return "no room was solved with this knowledge and light"
    of = "simulated rooms" if known.unseen else "simulated rooms that the settings were chosen on"
    worst = f"T {known.worst_temperature * contrast_k:.2g} K"
    if known.worst_velocity is not None:
        worst += f", velocity {100 * known.worst_velocity:.0f} %"
    return f"median of {known.rooms} {of}; the worst: {worst}"


def signals_of(problem: Problem, flow: ExpectedFlow) -> tuple[Signal, ...]:
    """Signal and noise of every view."""
    scene = problem.scene
    return tuple(
        signal(scene, n, flow, shift_noise(scene, n, resolve_window_px(scene, view)))
        for n, view in enumerate(scene.views)
    )


def _view_line(
    problem: Problem, view: int, flow: ExpectedFlow, found: Signal, places: PlacesLine | None
) -> ViewLine:
    scene, noise_px = problem.scene, found.noise.mean_px
    own, number = facing(scene, view)
    other, turn = other_light(own, number), turn_of(scene, view)
    frames, visible = scene.views[view].frames, np.isfinite(noise_px) and found.snr > 0
    return ViewLine(
        name=scene.views[view].name,
        light=own.light.kind,
        window_px=found.noise.window_px,
        noise_px=noise_px if np.isfinite(noise_px) else None,
        shift_median_px=found.shift.percentile_px(50),
        shift_p90_px=found.shift.percentile_px(90),
        shift_p99_px=found.shift.percentile_px(99),
        signal_to_noise=found.snr,
        picture_signal_to_noise=found.picture_snr if np.isfinite(noise_px) else 0.0,
        smallest_visible_k=found.smallest_visible_k
        if visible and np.isfinite(found.smallest_visible_k)
        else None,
        frames=frames,
        frames_needed=frames * found.frames_factor if visible and found.frames_factor < 1e12 else None,
        other_light=other.light.kind,
        other_light_shift_p99_px=shift_map(
            other, number, flow.facing(turn), found.noise.window_px
        ).percentile_px(99),
        map=_map(found),
        places=places,
    )


def _averaging(moves: Fluctuation | None) -> AveragingLine | None:
    if moves is None:
        return None
    wished_k = moves.round_errors_k()
    return AveragingLine(
        fluctuation_k=moves.std_k,
        stays_s=moves.time_s,
        error_k=wished_k,
        averaged_s=[moves.seconds_for(error_k) for error_k in wished_k],
    )


def places_of(scene: Scene) -> PlacesLine:
    """What the scene's first camera, which looks at y_max, would see of the expected flow from other places."""
    return _map_of_places(scene, 0, expected_flow(Problem(scene, ())))


def _places(problem: Problem, view: int, flow: ExpectedFlow) -> PlacesLine | None:
    """None of a view of another wall: the map is of the floor before y_max."""
    scene = problem.scene
    return _map_of_places(scene, view, flow) if scene.views[view].wall == "y_max" else None


def _map_of_places(scene: Scene, view: int, flow: ExpectedFlow) -> PlacesLine:
    found = place_map(scene, view, flow)
    return PlacesLine(
        x_m=found.x_m.tolist(),
        y_m=found.y_m.tolist(),
        picture_signal_to_noise=_rows(found.picture_snr),
        signal_to_noise=_rows(found.snr),
        wall_share=_rows(found.wall_share),
        camera_m=list(scene.views[view].camera.position_m),
        lower_m=list(scene.room.lower_m[:2]),
        upper_m=list(scene.room.upper_m[:2]),
    )


def _rows(values: np.ndarray) -> list[list[float | None]]:
    """JSON has no number for what is not there."""
    return [[round(float(v), 6) if np.isfinite(v) else None for v in row] for row in values]


def _map(found: Signal) -> MapLine:
    columns, rows = (np.unique(found.shift.centres_px[:, i]) for i in (0, 1))
    picture = np.full((len(rows), len(columns)), np.nan)
    at = (
        np.searchsorted(rows, found.shift.centres_px[:, 1]),
        np.searchsorted(columns, found.shift.centres_px[:, 0]),
    )
    picture[at] = 1e3 * np.linalg.norm(found.shift.displacement_px, axis=1)
    return MapLine(
        columns_px=[float(c) for c in columns],
        rows_px=[float(r) for r in rows],
        shift_mpx=_rows(picture),
    )


def _choice_line(choice: Choice) -> ChoiceLine:
    return ChoiceLine(
        name=choice.name,
        value=choice.value,
        bound=min(choice.bound, _LARGEST),
        limit=min(choice.limit, _LARGEST),
        unit=choice.unit,
        cost_share=choice.cost_share,
        reason=choice.reason,
    )
