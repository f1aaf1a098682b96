"""From unknowns to a `Solution`: the fields on the room's vertices, in SI units."""

from collections.abc import Sequence

import equinox as eqx
import numpy as np

from core.losses.boussinesq import FlowValues
from core.losses.representation import Spans, Unknowns, positions
from core.result import Outcome, Solution
from core.solve.nondimensional import RoomFrame
from core.watch import Row


def solution_of(
    unknowns: Unknowns,
    frame: RoomFrame,
    shape: tuple[int, int, int],
    outcome: Outcome,
    solver_s: float,
    history: Sequence[Row],
    notes: tuple[str, ...] = (),
) -> Solution:
    """Evaluate on a vertex grid of `shape`."""
    spans = frame.vertices(shape)
    temperature, pressure, velocity = frame.scales.to_si(_evaluate(unknowns, spans))
    x, y, z = (
        low + frame.scales.length_m * positions(span)
        for low, span in zip(frame.room.lower_m, spans, strict=True)
    )
    return Solution(
        x_m=x,
        y_m=y,
        z_m=z,
        temperature_k=np.asarray(temperature),
        pressure_m2_s2=np.asarray(pressure),
        velocity_m_s=np.asarray(velocity),
        outcome=outcome,
        solver_s=solver_s,
        history=tuple(history),
        notes=(*notes, *_used(unknowns, frame)),
    )


@eqx.filter_jit
def _evaluate(unknowns: Unknowns, spans: Spans) -> FlowValues:
    return unknowns.representation.fields().on_grid(spans)


def _used(unknowns: Unknowns, frame: RoomFrame) -> tuple[str, ...]:
    """Re and Pe that were used, and whether the camera's motion was found."""
    numbers = frame.numbers
    notes = [f"Transport as given: Re {numbers.reynolds:.4g}, Pe {numbers.peclet:.4g}."]
    if unknowns.drift is not None:
        notes.append("The motion of the camera between the exposures was solved for together with the air.")
    return tuple(notes)
