"""The scene: what is in front of the camera, and what is known about it. Only what is named is built.

A scene is data. `auto` leaves a choice to the bound that `core` computes for this scene; every other
value is used as given. Lists (`views`, `boundary`) may hold one entry or many; an empty `boundary`
means that nothing is known but the images.
"""

from itertools import combinations
from typing import Literal

from core.air import Air
from core.geometry import Box, Optics, Vector2, Vector3, WallName, face_of
from core.objects import RoomObject, shared_m
from core.setting import SettingError, check_kelvin, check_range, setting

Auto = Literal["auto"]


@setting
class CameraNoise:
    """How one frame scatters: shot noise, read noise, dark level and digitisation of a linear sensor."""

    full_well_e: float = 10_000.0
    """Electrons at the brightest count."""
    read_noise_e: float = 3.0
    """Rms of a dark frame, in electrons."""
    dark_counts: float = 64.0
    """Counts without light, far below the brightest."""
    bits: int = 12
    """Digits of a count, 1 to 16."""

    def __post_init__(self) -> None:
        if self.full_well_e <= 0 or self.read_noise_e < 0 or not 1 <= self.bits <= 16:
            raise SettingError(
                f"Camera noise has full_well_e {self.full_well_e:g}, read_noise_e {self.read_noise_e:g}, "
                f"bits {self.bits}; expected full_well_e > 0, read_noise_e >= 0, bits 1 to 16."
            )
        check_range("full_well_e", self.full_well_e, 1.0, 1e9, "electrons", "Take it from photon transfer.")
        check_range("read_noise_e", self.read_noise_e, 0.0, 1e6, "electrons", "Take it from dark frames.")
        check_range(
            "dark_counts", self.dark_counts, 0.0, 0.9 * (2**self.bits - 1), "counts",
            f"A dark frame of {self.bits} bits lies far below {2**self.bits - 1} counts: check both.",
        )  # fmt: skip


@setting
class WaveletPattern:
    """Wavelet noise (Cook & DeRose 2005): octave bands, the finest `finest_px` pattern pixels a period."""

    kind: Literal["wavelet"] = "wavelet"
    seed: int = 0
    """Which of all such patterns."""
    bands: int = 4
    """Octaves."""
    finest_px: float = 3.0
    """Finest period in pattern pixels."""
    contrast: float = 0.2
    """Rms of the luminance about 1/2."""


@setting
class DotPattern:
    """Random dark dots on white."""

    kind: Literal["dots"] = "dots"
    seed: int = 0
    """Which of all such patterns."""
    diameter_px: float = 4.0
    """A dot's diameter in pattern pixels."""
    coverage: float = 0.4
    """Inked share of the wall."""


@setting
class CheckerPattern:
    """A checkerboard with squares of `square_px`."""

    kind: Literal["checkerboard"] = "checkerboard"
    square_px: float = 8.0
    """A square's edge in pattern pixels."""


Pattern = WaveletPattern | DotPattern | CheckerPattern


@setting
class FixedTexture:
    """A print or a screen on the back wall: `pixel_m` is the size of one pattern pixel on the wall."""

    kind: Literal["texture"] = "texture"
    pattern: Pattern = WaveletPattern()
    """What is printed."""
    pixel_m: float = 0.001
    """Edge of one pattern pixel on the wall."""

    def __post_init__(self) -> None:
        check_range(
            "pixel_m, the size of a printed pattern pixel,", self.pixel_m, 1e-6, 0.5, "m",
            "Give metres (1 mm is 0.001 m).",
        )  # fmt: skip


@setting
class ProjectedPattern:
    """A projector, as an inverse camera, lighting a diffuse back wall."""

    kind: Literal["projector"] = "projector"
    pattern: Pattern = WaveletPattern()
    """What is projected."""
    projector: Optics
    """The projector, as a camera that sends light."""


Light = FixedTexture | ProjectedPattern


@setting
class Marks:
    """A rectangle of the picture in which a still board or marks stand, with none of the room's air before them.

    They hide the wall. What they do between two exposures is what the camera did.
    """

    name: str
    """What they are called in what is told of them."""
    lower_px: Vector2
    """Its upper left corner: column and row, counted from the middle of the first pixel."""
    upper_px: Vector2
    """Its lower right corner."""

    def __post_init__(self) -> None:
        if not all(low < high for low, high in zip(self.lower_px, self.upper_px, strict=True)):
            raise SettingError(
                f"The marks {self.name!r} have no area: {self.lower_px} to {self.upper_px} px. "
                "Give lower_px below upper_px, column and row, in pixels of the picture."
            )


@setting
class View:
    """One camera and the wall that it looks at. `frames` are averaged into one image."""

    name: str = "camera"
    """What this camera is called."""
    camera: Optics
    """Where it stands and how it looks."""
    wall: WallName = "y_max"
    """The patterned wall that it looks at."""
    light: Light | None = None
    """What patterns that wall; without it, the scene's light."""
    camera_of: str | None = None
    """The view whose camera takes these pictures too, in turn: under a projector of this view's own."""
    noise: CameraNoise = CameraNoise()
    """How its frames scatter."""
    frames: int = 100
    """How many frames are averaged into one picture."""
    f_number: float | None = None
    """The number on the lens; with `focal_m` it opens an aperture cone."""
    focal_m: float | None = None
    """Focal length of the lens."""
    drift_std_px: float = 1.0
    """Standard deviation of the mount's motion between exposures, at the picture's edge; 0: it stands still."""
    marks: tuple[Marks, ...] = ()
    """Where something still near the camera tells how the camera moved."""

    def __post_init__(self) -> None:
        check_range(
            "drift_std_px", self.drift_std_px, 0.0, 100.0, "px", "A mount creeps by 0.1 to 1 px in minutes."
        )
        names = [marks.name for marks in self.marks]
        if len(set(names)) < len(names):
            raise SettingError(
                f"The marks of view {self.name!r} are called {', '.join(names)}; give each a name of its own."
            )
        width, height = self.camera.width_px, self.camera.height_px
        for marks in self.marks:
            right, down = marks.upper_px
            if not (min(marks.lower_px) >= -0.5 and right <= width - 0.5 and down <= height - 0.5):
                raise SettingError(
                    f"The marks {marks.name!r} reach from {marks.lower_px} to {marks.upper_px} px; the picture of "
                    f"{self.name!r} has {width} x {height} px. Draw them within it."
                )
        check_range("frames", self.frames, 1, 1_000_000, "", "One image is the mean of at least one frame.")
        if self.f_number is not None:
            check_range(
                "f_number", self.f_number, 0.1, 1000.0, "", "It is the number on the lens (f/8 is 8)."
            )
        if self.focal_m is not None:
            check_range("focal_m", self.focal_m, 1e-4, 10.0, "m", "Give metres (25 mm is 0.025 m).")


@setting
class PlaneField:
    """T, p, u known all over a wall: an NPZ of y, z, T, p, u (and mask) in the experiment.

    T is that of the wall's surface, and of the air in openings. On a wall that is stated to be adiabatic it is that
    of the air beside it.
    """

    kind: Literal["plane_field"] = "plane_field"
    file: str
    """NPZ of y, z, T, p, u, in the experiment."""
    wall: WallName = "x_min"
    """The wall that the plane lies on."""


@setting
class Patch:
    """A rectangle on a wall: bounds along the wall's two axes in the order x, y, z [m]."""

    wall: WallName
    """The wall that it lies on."""
    lower_m: Vector2
    """Its smaller corner along the wall's two axes, in the order x, y, z."""
    upper_m: Vector2
    """Its larger corner."""

    def __post_init__(self) -> None:
        if not all(low < high for low, high in zip(self.lower_m, self.upper_m, strict=True)):
            raise SettingError(
                f"The patch on {self.wall} has no area: {self.lower_m} to {self.upper_m} m. "
                "Give lower_m below upper_m along both axes of the wall, in metres."
            )

    @property
    def centre_m(self) -> Vector2:
        """Its middle."""
        one_m, other_m = (0.5 * (low + high) for low, high in zip(self.lower_m, self.upper_m, strict=True))
        return one_m, other_m

    @property
    def area_m2(self) -> float:
        """Area of the rectangle."""
        return (self.upper_m[0] - self.lower_m[0]) * (self.upper_m[1] - self.lower_m[1])

    @property
    def hydraulic_diameter_m(self) -> float:
        """Four times the area over the circumference."""
        one_m, other_m = (high - low for low, high in zip(self.lower_m, self.upper_m, strict=True))
        return 2.0 * one_m * other_m / (one_m + other_m)


@setting
class Inlet:
    """Supply air through a patch; the standard deviations are the operator's uncertainty.

    `length_scale_m` is the mixing length of the supply's turbulence; None takes 0.07 of the patch's
    hydraulic diameter. k-epsilon rooms set the dissipation beside an opening by themselves, so it moves
    nothing there yet (`core.room.k_epsilon`).
    """

    kind: Literal["inlet"] = "inlet"
    patch: Patch
    """Where air comes in."""
    temperature_k: float
    """Its temperature."""
    velocity_m_s: Vector3
    """Its mean velocity: x, y, z, into the room."""
    temperature_std_k: float = 0.1
    """Standard deviation of the temperature."""
    velocity_std_m_s: float = 0.01
    """Standard deviation of the speed."""
    turbulence_intensity: float = 0.1
    """Rms of the fluctuations over the speed."""
    length_scale_m: float | None = None
    """Mixing length; without it, 0.07 of the hydraulic diameter."""

    @property
    def inward_m_s(self) -> float:
        """The part of its velocity straight off its wall, into the room."""
        face = face_of(self.patch.wall)
        return face.inward * self.velocity_m_s[face.axis]

    def __post_init__(self) -> None:
        check_kelvin("The inlet's temperature", self.temperature_k)
        _check_std("The inlet's temperature_std_k", self.temperature_std_k, "K")
        _check_std("The inlet's velocity_std_m_s", self.velocity_std_m_s, "m/s")
        for speed_m_s in self.velocity_m_s:
            check_range(
                "A component of the inlet's velocity", speed_m_s, -100.0, 100.0, "m/s",
                "Give metres a second (500 mm/s is 0.5 m/s); air near the speed of sound is not modelled.",
            )  # fmt: skip
        check_range(
            "turbulence_intensity", self.turbulence_intensity, 0.0, 1.0, "",
            "It is a share of the speed (10 % is 0.1).",
        )  # fmt: skip
        if self.length_scale_m is not None:
            check_range("length_scale_m", self.length_scale_m, 1e-6, 100.0, "m", "Give metres.")


@setting
class Outlet:
    """Air leaves through a patch; its mean temperature is one thermometer, which fixes the level of T."""

    kind: Literal["outlet"] = "outlet"
    patch: Patch
    """Where air leaves."""
    flow_m3_s: float | None = None
    """What leaves by it; outlets without it share what remains of the supplies' flow by area."""
    mean_temperature_k: float | None = None
    """A thermometer in it; without it the outlet fixes no level."""
    temperature_std_k: float = 0.1
    """Standard deviation of that thermometer."""

    def __post_init__(self) -> None:
        if self.mean_temperature_k is not None:
            check_kelvin("The outlet's mean temperature", self.mean_temperature_k)
        if self.flow_m3_s is not None and not 0.0 < self.flow_m3_s < 100.0:
            raise SettingError(
                f"The outlet's flow_m3_s is {self.flow_m3_s:g} m3/s; expected what leaves by it, above 0 and below "
                "100 m3/s. Leave it out where it is not known."
            )
        _check_std("The outlet's temperature_std_k", self.temperature_std_k, "K")


@setting
class Wall:
    """A wall: no-slip if `no_slip`; its thermal condition given or unknown."""

    kind: Literal["wall"] = "wall"
    wall: WallName
    """Which one."""
    no_slip: bool = True
    """Whether air sticks to it."""
    thermal: Literal["unknown", "adiabatic", "temperature"] = "unknown"
    """What is known: nothing, that it passes no heat, or its temperature."""
    temperature_k: float | None = None
    """Its surface's temperature."""
    temperature_std_k: float = 0.1
    """Standard deviation of it."""

    def __post_init__(self) -> None:
        if (self.thermal == "temperature") != (self.temperature_k is not None):
            raise SettingError(
                f"Wall {self.wall} has thermal = {self.thermal!r} and temperature_k = {self.temperature_k}; "
                "give temperature_k with thermal = 'temperature', and only then."
            )
        if self.temperature_k is not None:
            check_kelvin(f"The temperature of wall {self.wall}", self.temperature_k)
        _check_std(f"temperature_std_k of wall {self.wall}", self.temperature_std_k, "K")


@setting
class Heater:
    """A patch held at a temperature (a radiator, a heated floor panel, a cooled ceiling)."""

    kind: Literal["heater"] = "heater"
    patch: Patch
    """Where it is."""
    temperature_k: float
    """Its surface's temperature."""
    temperature_std_k: float = 0.5
    """Standard deviation of it."""

    def __post_init__(self) -> None:
        check_kelvin("The heater's temperature", self.temperature_k)
        _check_std("The heater's temperature_std_k", self.temperature_std_k, "K")


@setting
class PointSensors:
    """Thermometers and anemometers: a CSV of x, y, z, T, T_std and/or u, v, w, u_std in the experiment."""

    kind: Literal["sensors"] = "sensors"
    file: str
    """CSV of x, y, z, T, T_std, u, v, w, u_std, in the experiment."""


BoundaryInformation = PlaneField | Inlet | Outlet | Wall | Heater | PointSensors
# The kinds that take a place on a wall, no two the same; and those that drive the air.
OnPatch = Inlet | Outlet | Heater
Driving = Inlet | Heater


@setting
class FlowModel:
    """Transport of momentum and heat: molecular, given effective coefficients, or a closure."""

    transport: Literal["auto", "molecular", "given", "zero_equation", "k_epsilon", "large_eddies"] = "auto"
    """How momentum and heat spread."""
    viscosity_m2_s: float | None = None
    """With `given`: effective viscosity, 1e-9 to 1e3."""
    diffusivity_m2_s: float | None = None
    """With `given`: effective diffusivity, 1e-9 to 1e3."""

    def __post_init__(self) -> None:
        for name in ("viscosity_m2_s", "diffusivity_m2_s"):
            value = getattr(self, name)
            advice = "Air has 1.5e-5 m2/s; with a room's turbulence about 1e-3."
            if value is not None:
                check_range(name, value, 1e-9, 1e3, "m2/s", advice)


@setting
class RayModel:
    """How rays are traced and the pattern is looked up; `auto` resolves from bounds."""

    tracer: Literal["auto", "straight", "quasi_linear", "nonlinear"] = "auto"
    """How a ray bends."""
    steps: int | Auto = "auto"
    """Steps along a ray."""
    projector_order: Literal[1, 2] | Auto = "auto"
    """Terms of the projector's own shift."""
    irradiance: bool | Auto = "auto"
    """Whether the air gathers and spreads the projector's light."""
    samples_per_pixel: int | Auto = "auto"
    """Rays averaged over a pixel."""
    aperture_cone: bool | Auto = "auto"
    """Whether the lens is a disc; it needs `f_number` and `focal_m`."""

    def __post_init__(self) -> None:
        if self.steps != "auto":
            check_range("steps", self.steps, 1, 16_384, "", "64 serve a room; take 'auto' when in doubt.")
        if self.samples_per_pixel != "auto":
            check_range("samples_per_pixel", self.samples_per_pixel, 1, 1024, "", "Nine serve most scenes.")


@setting
class SolveModel:
    """What the reconstruction works on; `auto` resolves from the scene and the noise."""

    data_term: Literal["auto", "rendered", "warped", "displacement"] = "auto"
    """What is compared: images, images moved back, or shifts."""
    grid: int | Auto = "auto"
    """Cells along an edge of the room."""
    window_px: int | Auto = "auto"
    """Edge of the window that one shift is measured in."""

    def __post_init__(self) -> None:
        if self.grid != "auto":
            check_range("grid", self.grid, 2, 1024, "cells", "32 to 64 cells an axis serve a room.")
        if self.window_px != "auto":
            check_range("window_px", self.window_px, 2, 4096, "px", "32 px serve a camera of 4096 px.")


@setting
class Scene:
    """Room, air, views, light, what is known at the boundary, and how to model it."""

    room: Box
    """The box that the air is in."""
    air: Air = Air()
    """The air at rest."""
    views: tuple[View, ...]
    """The cameras, one at least."""
    light: Light
    """What patterns the wall."""
    boundary: tuple[BoundaryInformation, ...] = ()
    """What is known of openings, walls and sensors; empty: the pictures alone."""
    objects: tuple[RoomObject, ...] = ()
    """What stands in the room: people, desks, cabinets."""
    flow: FlowModel = FlowModel()
    """How air moves in the model."""
    rays: RayModel = RayModel()
    """How light is traced."""
    solve: SolveModel = SolveModel()
    """What the reconstruction works on."""

    def __post_init__(self) -> None:
        if not self.views:
            raise SettingError("The scene has no view; give at least one camera under [[scene.views]].")
        names = [view.name for view in self.views]
        for view in self.views:
            if names.count(view.name) > 1:
                raise SettingError(
                    f"Two views are called {view.name!r}; calibrations and captures name views, so give each a name "
                    "of its own."
                )
            _check_place(f"Camera {view.name!r}", view.camera.position_m, self.room, view.wall)
            if isinstance(view.light, ProjectedPattern):
                _check_place(
                    f"The projector of {view.name!r}", view.light.projector.position_m, self.room, view.wall
                )
            if view.light is None and view.wall != "y_max" and isinstance(self.light, ProjectedPattern):
                raise SettingError(
                    f"View {view.name!r} looks at {view.wall}, and the scene's projector lights y_max. Give the view "
                    "a light of its own."
                )
        if isinstance(self.light, ProjectedPattern):
            _check_place("The projector", self.light.projector.position_m, self.room, "y_max")
        for view in self.views:
            _check_camera_of(self, view)
        _check_objects(self)


def _check_camera_of(scene: Scene, view: View) -> None:
    """A camera that serves several views sees the same wall in each, under one projector at a time."""
    if view.camera_of is None:
        return
    named = f"View {view.name!r} is taken by the camera of {view.camera_of!r}"
    owner = next((one for one in scene.views if one.name == view.camera_of), None)
    if owner is None or owner is view or owner.camera_of is not None:
        whose = [repr(one.name) for one in scene.views if one.camera_of is None and one is not view]
        raise SettingError(
            f"{named}; expected a view that has a camera of its own: {', '.join(whose) or 'there is none'}."
        )
    if view.wall != owner.wall:
        raise SettingError(
            f"{named} and looks at {view.wall}, that one at {owner.wall}. Give both the same wall, or this view a "
            "camera of its own."
        )
    theirs = owner.light or scene.light
    if not (isinstance(view.light, ProjectedPattern) and isinstance(theirs, ProjectedPattern)):
        raise SettingError(
            f"{named}; expected a projector for each of the two, to light the wall in turn. Give this view a light "
            "of its own of kind 'projector'; a print on the wall cannot be switched off."
        )


def _check_std(what: str, value: float, unit: str) -> None:
    check_range(what, value, 1e-9, 1e6, unit, "It is one standard deviation: nothing is known exactly.")


def _check_place(what: str, position_m: Vector3, room: Box, wall: WallName) -> None:
    """In front of the wall that it looks at; farther than 2 km from the room a position is in other units."""
    x, y, z = position_m
    face = face_of(wall)
    place_m = face.place_m(room)
    if face.inward * (position_m[face.axis] - place_m) <= 0:
        axis, side = "xyz"[face.axis], "smaller" if face.upper else "larger"
        named = "the back wall" if wall == "y_max" else f"the wall {wall},"
        raise SettingError(
            f"{what} at ({x:g}, {y:g}, {z:g}) m is in or behind {named} {axis} = {place_m:g} m; place it in front of "
            f"the wall ({side} {axis})."
        )
    reach_m = sum((p - c) ** 2 for p, c in zip(position_m, room.centre_m, strict=True)) ** 0.5
    advice = "Were millimetres given for metres?"
    check_range(f"{what}'s distance from the room", reach_m, 0.0, 2000.0, "m", advice)


def _check_objects(scene: Scene) -> None:
    """Objects lie in the room, apart from one another, with names of their own, and before no opening."""
    for item in scene.objects:
        _check_inside(item, scene.room)
        for part in scene.boundary:
            if isinstance(part, Inlet | Outlet) and stands_before(item, part.patch, scene.room):
                raise SettingError(
                    f"The object {item.name!r} stands against the {part.kind} on {part.patch.wall} "
                    f"({part.patch.lower_m} to {part.patch.upper_m} m), so no air can pass there. Move one of them."
                )
    for one, other in combinations(scene.objects, 2):
        if one.name == other.name:
            raise SettingError(
                f"Two objects are called {one.name!r}; results name objects, so give each a name of its own."
            )
        if min(shared_m(one, other)) > 1e-6:
            raise SettingError(
                f"The objects {one.name!r} and {other.name!r} overlap; move one, or make one of the two smaller."
            )


def _check_inside(item: RoomObject, room: Box) -> None:
    for a, axis in enumerate("xyz"):
        if item.lower_m[a] < room.lower_m[a] - 1e-6 or item.upper_m[a] > room.upper_m[a] + 1e-6:
            raise SettingError(
                f"The object {item.name!r} spans {item.lower_m[a]:g} to {item.upper_m[a]:g} m along {axis}; the "
                f"room spans {room.lower_m[a]:g} to {room.upper_m[a]:g} m. Move it into the room."
            )


def stands_before(item: RoomObject, patch: Patch, room: Box) -> bool:
    """Whether the object touches the patch's wall (within 1 mm) over a part of the patch."""
    face = face_of(patch.wall)
    side_m = (item.upper_m if face.upper else item.lower_m)[face.axis]
    if abs(side_m - face.place_m(room)) > 1e-3:
        return False
    shared = [
        min(item.upper_m[a], high) - max(item.lower_m[a], low)
        for a, low, high in zip(face.along, patch.lower_m, patch.upper_m, strict=True)
    ]
    return min(shared) > 1e-6
