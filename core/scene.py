"""The scene: what is in front of the camera, and what is known about it. Only what is named is built.

A scene is data. `auto` leaves a choice to the bound that `core` computes for this scene; every other
value is used as given. Lists (`views`, `boundary`) may hold one entry or many; an empty `boundary`
means that nothing is known but the images.
"""

from typing import Literal

from core.air import Air
from core.geometry import Box, Optics, Vector2, Vector3, WallName
from core.setting import SettingError, setting

Auto = Literal["auto"]


@setting
class CameraNoise:
    """How one frame scatters: shot noise, read noise, dark level and digitisation of a linear sensor."""

    full_well_e: float = 10_000.0
    read_noise_e: float = 3.0
    dark_counts: float = 64.0
    bits: int = 12

    def __post_init__(self) -> None:
        if self.full_well_e <= 0 or self.read_noise_e < 0 or not 1 <= self.bits <= 16:
            raise SettingError(
                f"Camera noise has full_well_e {self.full_well_e:g}, read_noise_e {self.read_noise_e:g}, "
                f"bits {self.bits}; expected full_well_e > 0, read_noise_e >= 0, bits 1 to 16."
            )


@setting
class View:
    """One camera. `frames` are averaged into one image; `f_number` with `focal_m` opens an aperture cone."""

    name: str = "camera"
    camera: Optics
    noise: CameraNoise = CameraNoise()
    frames: int = 100
    f_number: float | None = None
    focal_m: float | None = None


@setting
class WaveletPattern:
    """Wavelet noise (Cook & DeRose 2005): octave bands, the finest `finest_px` pattern pixels a period."""

    kind: Literal["wavelet"] = "wavelet"
    seed: int = 0
    bands: int = 4
    finest_px: float = 3.0
    contrast: float = 0.2


@setting
class DotPattern:
    """Random dark dots on white."""

    kind: Literal["dots"] = "dots"
    seed: int = 0
    diameter_px: float = 4.0
    coverage: float = 0.4


@setting
class CheckerPattern:
    """A checkerboard with squares of `square_px`."""

    kind: Literal["checkerboard"] = "checkerboard"
    square_px: float = 8.0


Pattern = WaveletPattern | DotPattern | CheckerPattern


@setting
class FixedTexture:
    """A print or a screen on the back wall: `pixel_m` is the size of one pattern pixel on the wall."""

    kind: Literal["texture"] = "texture"
    pattern: Pattern = WaveletPattern()
    pixel_m: float = 0.001


@setting
class ProjectedPattern:
    """A projector, as an inverse camera, lighting a diffuse back wall."""

    kind: Literal["projector"] = "projector"
    pattern: Pattern = WaveletPattern()
    projector: Optics


Light = FixedTexture | ProjectedPattern


@setting
class PlaneField:
    """T, p, u known on a plane across the room: an NPZ of y, z, T, p, u (and mask) in the experiment."""

    kind: Literal["plane_field"] = "plane_field"
    file: str
    wall: WallName = "x_min"


@setting
class Patch:
    """A rectangle on a wall: bounds along the wall's two axes in the order x, y, z [m]."""

    wall: WallName
    lower_m: Vector2
    upper_m: Vector2


@setting
class Inlet:
    """Supply air through a patch; the standard deviations are the operator's uncertainty.

    `length_scale_m` is the mixing length of the supply's turbulence; None takes 0.07 of the patch's
    hydraulic diameter.
    """

    kind: Literal["inlet"] = "inlet"
    patch: Patch
    temperature_k: float
    velocity_m_s: Vector3
    temperature_std_k: float = 0.1
    velocity_std_m_s: float = 0.01
    turbulence_intensity: float = 0.1
    length_scale_m: float | None = None


@setting
class Outlet:
    """Air leaves through a patch; its mean temperature is one thermometer, which fixes the level of T."""

    kind: Literal["outlet"] = "outlet"
    patch: Patch
    mean_temperature_k: float | None = None
    temperature_std_k: float = 0.1


@setting
class Wall:
    """A wall: no-slip if `no_slip`; its thermal condition given or unknown."""

    kind: Literal["wall"] = "wall"
    wall: WallName
    no_slip: bool = True
    thermal: Literal["unknown", "adiabatic", "temperature"] = "unknown"
    temperature_k: float | None = None
    temperature_std_k: float = 0.1

    def __post_init__(self) -> None:
        if (self.thermal == "temperature") != (self.temperature_k is not None):
            raise SettingError(
                f"Wall {self.wall} has thermal = {self.thermal!r} and temperature_k = {self.temperature_k}; "
                "give temperature_k with thermal = 'temperature', and only then."
            )


@setting
class Heater:
    """A patch held at a temperature (a radiator, a heated floor panel, a cooled ceiling)."""

    kind: Literal["heater"] = "heater"
    patch: Patch
    temperature_k: float
    temperature_std_k: float = 0.5


@setting
class PointSensors:
    """Thermometers and anemometers: a CSV of x, y, z, T, T_std and/or u, v, w, u_std in the experiment."""

    kind: Literal["sensors"] = "sensors"
    file: str


BoundaryInformation = PlaneField | Inlet | Outlet | Wall | Heater | PointSensors


@setting
class FlowModel:
    """Transport of momentum and heat: molecular, given effective coefficients, or a closure / learned."""

    transport: Literal["auto", "molecular", "given", "zero_equation", "k_epsilon", "learned"] = "auto"
    viscosity_m2_s: float | None = None
    diffusivity_m2_s: float | None = None


@setting
class RayModel:
    """How rays are traced and the pattern is looked up; `auto` resolves from bounds."""

    tracer: Literal["auto", "straight", "quasi_linear", "nonlinear"] = "auto"
    steps: int | Auto = "auto"
    projector_order: Literal[1, 2] | Auto = "auto"
    irradiance: bool | Auto = "auto"
    samples_per_pixel: int | Auto = "auto"
    aperture_cone: bool | Auto = "auto"


@setting
class SolveModel:
    """What the reconstruction works on; `auto` resolves from the scene and the noise."""

    data_term: Literal["auto", "rendered", "warped", "displacement"] = "auto"
    grid: int | Auto = "auto"
    window_px: int | Auto = "auto"


@setting
class Scene:
    """Room, air, views, light, what is known at the boundary, and how to model it."""

    room: Box
    air: Air = Air()
    views: tuple[View, ...]
    light: Light
    boundary: tuple[BoundaryInformation, ...] = ()
    flow: FlowModel = FlowModel()
    rays: RayModel = RayModel()
    solve: SolveModel = SolveModel()

    def __post_init__(self) -> None:
        if not self.views:
            raise SettingError("The scene has no view; give at least one camera under [[scene.views]].")
        for view in self.views:
            x, y, z = view.camera.position_m
            if y >= self.room.upper_m[1]:
                raise SettingError(
                    f"Camera {view.name!r} at ({x:g}, {y:g}, {z:g}) m is in or behind the back wall "
                    f"y = {self.room.upper_m[1]:g} m; place it in front of the wall (smaller y)."
                )
