"""Worlds that a simulated rig may stand in: one that spoils nothing, and one like a lab's."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Literal

from pydantic import ValidationError

from app.errors import BadInputError
from app.experiment.rig_settings import SimulatedCameraSettings, World
from app.volume.scene import RigName

Border = Literal["print", "bare", "room"]
WorldName = Literal["ideal", "lab"]


@dataclass(frozen=True)
class RigWorld:
    """What spoils the pictures, the mount's step between bursts, the border, whether entries are misread.

    What may tell the mount's step: `marks` near the camera, and a second reference (`bracketed`). `place` is where
    its rig stands unless somebody says otherwise.
    """

    world: World = field(default_factory=World)
    drift_px: float = 0.0
    border: Border = "print"
    misreads: bool = False
    marks: bool = False
    bracketed: bool = False
    place: RigName = "paper"

    def camera(self, seed: int, noise_free: bool = False) -> SimulatedCameraSettings:
        """A camera in this world."""
        return SimulatedCameraSettings(
            seed=seed, drift_px=self.drift_px, border=self.border, world=self.world, noise_free=noise_free
        )


IDEAL = RigWorld(drift_px=0.1)
# Judged: what a fixed lens, a LED lamp on mains and a tripod on a concrete floor show.
LAB = RigWorld(
    World(
        blur_px=0.6,
        vignetting=0.3,
        vibration_px=0.1,
        breathing_px=0.05,
        lamp=0.01,
        ripple=0.01,
        flicker=0.003,
        hot_pixels=1e-5,
        marks_blur_px=2.0,
        covered=0.05,
    ),
    drift_px=0.3,
    border="bare",
    misreads=True,
    place="lab",
)
WORLDS: Mapping[WorldName, RigWorld] = {"ideal": IDEAL, "lab": LAB}


def changed(
    world: RigWorld,
    nuisances: list[str],
    drift_px: float | None = None,
    border: Border | None = None,
    misreads: bool | None = None,
) -> RigWorld:
    """The world with other values; a nuisance is `name=value`. Raises BadInputError."""
    own = world.world.model_dump()
    for text in nuisances:
        name, _, value = text.partition("=")
        if name not in own or not value:
            raise BadInputError(
                f"{text!r} is no nuisance of a world; expected NAME=VALUE, one of {', '.join(own)}."
            )
        try:
            own[name] = float(value)
        except ValueError:
            raise BadInputError(f"{text!r}: {value!r} is no number.") from None
    try:
        spoiling = World.model_validate(own)
    except ValidationError as error:
        first = error.errors()[0]
        raise BadInputError(f"{first['loc'][0]}={first['input']}: {first['msg']}.") from None
    return replace(
        world,
        world=spoiling,
        drift_px=world.drift_px if drift_px is None else drift_px,
        border=border or world.border,
        misreads=world.misreads if misreads is None else misreads,
    )


def one_by_one(world: RigWorld) -> dict[str, RigWorld]:
    """Nothing, each nuisance of `world` alone, and all of them: as they are, and with what may tell the drift."""
    nothing = RigWorld()
    default = nothing.world.model_dump()
    spoiling = {name: value for name, value in world.world.model_dump().items() if value != default[name]}
    return {
        "nothing": nothing,
        **{name: replace(nothing, world=World.model_validate({name: v})) for name, v in spoiling.items()},
        "drift": replace(nothing, drift_px=world.drift_px),
        "drift, nothing still": replace(nothing, drift_px=world.drift_px, border="bare"),
        "entries misread": replace(nothing, misreads=True),
        "all, still border": replace(world, border="print"),
        "all, textured room": replace(world, border="room"),
        "all, marks": replace(world, marks=True),
        "all, bracketed": replace(world, bracketed=True),
        "all": world,
    }
