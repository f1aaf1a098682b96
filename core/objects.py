"""What stands in the room: boxes with a thermal condition, and ready ones with sizes and heat from the literature."""

from collections.abc import Sequence
from typing import Literal

import numpy as np
from jaxtyping import Bool

from core.geometry import Vector3
from core.setting import SettingError, check_kelvin, check_range, setting


@setting
class RoomObject:
    """A solid box in the room, its faces parallel to the walls: a person, a desk, a cabinet.

    No air is in it, and no air flows through its faces.
    """

    name: str
    """What it is called in results."""
    lower_m: Vector3
    """The corner with the smallest x, y and z."""
    upper_m: Vector3
    """The corner with the largest x, y and z."""
    thermal: Literal["adiabatic", "temperature", "power"] = "adiabatic"
    """What is known: that it passes no heat, its surface's temperature, or the heat that it gives to the air."""
    temperature_k: float | None = None
    """With `temperature`: that of its surface."""
    temperature_std_k: float = 0.5
    """Standard deviation of it."""
    power_w: float | None = None
    """With `power`: its convective heat in watts; below 0 where it cools the air. Radiation is not part of it."""
    power_std_w: float = 15.0
    """Standard deviation of it."""

    def __post_init__(self) -> None:
        if not all(low < high for low, high in zip(self.lower_m, self.upper_m, strict=True)):
            raise SettingError(
                f"The object {self.name!r} has no volume: {self.lower_m} to {self.upper_m} m. "
                "Give lower_m below upper_m along all three axes, in metres."
            )
        given = {"temperature": self.temperature_k, "power": self.power_w}
        for kind, value in given.items():
            key = "temperature_k" if kind == "temperature" else "power_w"
            if (self.thermal == kind) != (value is not None):
                raise SettingError(
                    f"The object {self.name!r} has thermal = {self.thermal!r} and {key} = {value}; "
                    f"give {key} with thermal = {kind!r}, and only then."
                )
        if self.temperature_k is not None:
            check_kelvin(f"The temperature of the object {self.name!r}", self.temperature_k)
        if self.power_w is not None:
            check_range(
                f"power_w of the object {self.name!r}",
                self.power_w,
                -1e5,
                1e5,
                "W",
                "A person gives about 75 W.",
            )
        for what, std, unit in (
            ("temperature_std_k", self.temperature_std_k, "K"),
            ("power_std_w", self.power_std_w, "W"),
        ):
            check_range(
                f"{what} of the object {self.name!r}", std, 1e-9, 1e6, unit,
                "It is one standard deviation: nothing is known exactly.",
            )  # fmt: skip

    @property
    def size_m(self) -> Vector3:
        """Extent along x, y, z."""
        x, y, z = (high - low for low, high in zip(self.lower_m, self.upper_m, strict=True))
        return x, y, z


def inside_objects(
    objects: Sequence[RoomObject], axes_m: tuple[np.ndarray, np.ndarray, np.ndarray]
) -> Bool[np.ndarray, "nx ny nz"]:
    """Which points of a grid lie in or on an object."""
    inside = np.zeros([len(axis) for axis in axes_m], bool)
    for item in objects:
        x, y, z = (
            (axis >= low - 1e-5) & (axis <= high + 1e-5)
            for axis, low, high in zip(axes_m, item.lower_m, item.upper_m, strict=True)
        )
        inside |= x[:, None, None] & y[None, :, None] & z[None, None, :]
    return inside


def shared_m(one: RoomObject, other: RoomObject) -> Vector3:
    """How far two boxes reach into one another along each axis; 0 or below where they do not."""
    x, y, z = (
        min(h1, h2) - max(l1, l2)
        for l1, h1, l2, h2 in zip(one.lower_m, one.upper_m, other.lower_m, other.upper_m, strict=True)
    )
    return x, y, z


@setting
class ReadyObject:
    """A kind of object that rooms often hold: its size, its heat, and where both come from."""

    size_m: Vector3 | None = None
    """Extent along x, y, z, as seen by the camera; None for one that has none of its own."""
    power_w: float | None = None
    """Its convective heat; None for one that gives none."""
    power_std_w: float = 15.0
    """Standard deviation of it."""
    source: str
    """Where size and heat come from."""


# A person's power is all the sensible heat. A third to two thirds of it leaves as radiation and reaches the air by
# way of the walls; the deviation covers that.
READY: dict[str, ReadyObject] = {
    "box": ReadyObject(source="as it is told"),
    "seated_person": ReadyObject(
        size_m=(0.4, 0.4, 1.2), power_w=75.0, power_std_w=20.0,
        source="75 W sensible, office work: ASHRAE Fundamentals 2017, ch. 18, table 1; "
        "surface of 1.8 m2: DuBois and DuBois 1916",
    ),
    "standing_person": ReadyObject(
        size_m=(0.45, 0.25, 1.75), power_w=75.0, power_std_w=25.0,
        source="75 W sensible, standing, light work: ASHRAE Fundamentals 2017, ch. 18, table 1; "
        "height and shoulders: usual of adults",
    ),
    "desk": ReadyObject(size_m=(1.6, 0.8, 0.74), source="height: EN 527-1; a usual table top; as a solid block"),
    "cabinet": ReadyObject(size_m=(0.8, 0.42, 1.95), source="a usual office cabinet of five files"),
    "screen": ReadyObject(
        size_m=(0.55, 0.1, 0.35), power_w=25.0, power_std_w=10.0,
        source="a display of 24 inches; 15 to 35 W when on, by makers' data sheets",
    ),
    "radiator": ReadyObject(
        size_m=(1.0, 0.1, 0.6), power_w=600.0, power_std_w=200.0,
        source="panel radiator of type 22, 30 K warmer than the room, by EN 442's exponent 1.3; "
        "two thirds of its heat by convection: judged",
    ),
}  # fmt: skip


def ready_object(kind: str, name: str, foot_m: Vector3, size_m: Vector3 | None = None) -> RoomObject:
    """A ready object whose foot has its middle at `foot_m`; `size_m` replaces its own size.

    Raises SettingError for an unknown kind, and for a box without a size.
    """
    if kind not in READY:
        raise SettingError(f"There is no ready object {kind!r}; expected one of {', '.join(READY)}.")
    ready, (x, y, z) = READY[kind], foot_m
    size_m = size_m or ready.size_m
    if size_m is None:
        raise SettingError(f"{name!r} has no size; give its extent along x, y and z in metres.")
    sx, sy, sz = size_m
    return RoomObject(
        name=name,
        lower_m=(x - sx / 2, y - sy / 2, z),
        upper_m=(x + sx / 2, y + sy / 2, z + sz),
        thermal="adiabatic" if ready.power_w is None else "power",
        power_w=ready.power_w,
        power_std_w=ready.power_std_w,
    )
