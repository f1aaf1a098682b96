"""The patches of an OpenFOAM case: one a wall, one an object, and what the scene tells of an object's heat."""

import re
from collections.abc import Sequence
from dataclasses import dataclass

from app.report.blocks import Blocks, Side
from core.air import Air
from core.geometry import WALLS
from core.objects import RoomObject


@dataclass(frozen=True)
class MeshPatch:
    """Faces of the mesh under one name: a wall's (`item` is None) or an object's."""

    name: str
    sides: tuple[Side, ...]
    item: RoomObject | None = None


def patches_of(blocks: Blocks, objects: Sequence[RoomObject]) -> list[MeshPatch]:
    """The walls, then the objects; what has no face in the air has no patch."""
    sides = blocks.sides()
    walls = [
        MeshPatch(name, tuple(side for side in sides if side.solid < 0 and side.number == number))
        for number, name in enumerate(WALLS)
    ]
    solids = [
        MeshPatch(name, tuple(side for side in sides if side.solid == number), objects[number])
        for number, name in enumerate(_words([item.name for item in objects]))
    ]
    return [patch for patch in (*walls, *solids) if patch.sides]


def _words(names: Sequence[str]) -> list[str]:
    """The names as OpenFOAM takes them: letters, digits and underscores, none twice, none a wall's."""
    found: list[str] = []
    for name in names:
        word = re.sub(r"[^A-Za-z0-9_]", "_", name)
        word = word if word[:1].isalpha() else f"object_{word}"
        while word in found or word in WALLS:
            word += "_"
        found.append(word)
    return found


def thermal_of(blocks: Blocks, patch: MeshPatch, air: Air) -> str:
    """What is known of a patch's temperature.

    The power of an object leaves it evenly and by conduction in the air alone, so that no model of turbulence is
    needed to read the case: gradient = power / (area times conductivity).
    """
    item, told, note = patch.item, "type zeroGradient;", ""
    if item is not None and item.temperature_k is not None:
        told = f"type fixedValue; value uniform {item.temperature_k:.7g};"
    if item is not None and item.power_w is not None:
        area_m2 = sum(blocks.area_m2(side) for side in patch.sides)
        conductivity = air.heat_capacity_j_m3_k * air.kinematic_viscosity_m2_s / air.prandtl
        told = f"type fixedGradient; gradient uniform {item.power_w / (area_m2 * conductivity):.7g};"
        note = (
            f"    // {item.power_w:g} W, give or take {item.power_std_w:g} W, through {area_m2:.6g} m2 by "
            f"conduction at {conductivity:.4g} W/(m K). With turbulence at the wall, set the power itself instead\n"
            "    // (externalWallHeatFluxTemperature, mode power).\n"
        )
    return f"{note}    {patch.name} {{ {told} }}"
