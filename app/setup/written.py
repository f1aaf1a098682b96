"""Values as a person writes them, with units, and what a reading of a scene has found that no answer says."""

from dataclasses import dataclass, field

from core.geometry import Vector3

_KELVIN = 273.15


@dataclass
class SceneReading:
    """What is being read: the room's corner, and what has been found that no answer says."""

    corner_m: Vector3
    unsaid: list[str] = field(default_factory=list)

    def place(self, at_m: Vector3) -> list[str]:
        """A place of the world, measured from the room's corner."""
        return [metres(value - corner) for value, corner in zip(at_m, self.corner_m, strict=True)]


def metres(value_m: float) -> str:
    """A length as it is written; to the micrometre, which is less than a tape measure's own digits."""
    return f"{_plain(value_m, 6)} m"


def celsius(value_k: float) -> str:
    """A temperature as it is written; in kelvin where C would look like kelvin."""
    value = value_k - _KELVIN
    return f"{_plain(value_k, 6)} K" if 250 <= value <= 330 else f"{_plain(value, 6)} C"


def _plain(value: float, digits: int) -> str:
    return f"{round(value, digits) + 0.0:.12g}"
