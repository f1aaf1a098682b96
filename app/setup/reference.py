"""A reference of experiment.toml and of the answers of `new`, made from the models: nothing of it is written twice.

A key's meaning is the text below its field; its unit is its name's ending, its range what the models check, its
example the first value in the templates. `airlens schema --markdown` prints it.
"""

import ast
import dataclasses
import inspect
import sys
import textwrap
import tomllib
import types
import typing
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cache
from typing import Any

from pydantic import BaseModel, TypeAdapter
from pydantic_core import PydanticUndefined

from app.experiment.folder import ExperimentSettings
from app.files.toml import from_toml, to_plain
from app.setup.answers import Answers
from app.setup.experiment import TEMPLATES, template
from app.setup.scene import settings_of
from app.setup.units import UNITS, Written
from core.pattern import make
from core.scene import CheckerPattern, DotPattern, WaveletPattern

# What no template shows.
_MORE = """
[rig.camera]
kind = "simulated"
[rig.projector]
url = "pjlink://192.168.0.20"
[rig.board]
columns = 9
rows = 6
square_m = 0.03
marker_m = 0.0225
[[scene.views]]
f_number = 8.0
focal_m = 0.025
[[scene.views.marks]]
name = "left board"
lower_px = [0.0, 0.0]
upper_px = [320.0, 180.0]
[scene.light]
kind = "projector"
[scene.light.projector]
width_px = 1920
[[scene.boundary]]
kind = "plane_field"
file = "boundary/plane_x_min.npz"
[[scene.boundary]]
kind = "inlet"
length_scale_m = 0.02
[[scene.boundary]]
kind = "outlet"
flow_m3_s = 0.0167
[[scene.objects]]
name = "person"
lower_m = [1.8, 1.3, 0.0]
upper_m = [2.2, 1.7, 1.2]
thermal = "power"
power_w = 75.0
[[scene.objects]]
name = "cabinet"
temperature_k = 295.15
[scene.flow]
viscosity_m2_s = 1e-3
diffusivity_m2_s = 1e-3
[scene.air]
gladstone_dale = 2.26e-4
"""
_VISION = """
[rig.camera]
kind = "aravis"
device = "192.168.0.30"
pixel_format = "Mono12"
width_px = 1920
height_px = 1200
bits = 12
exposure_s = 0.02
"""
_MORE_ANSWERS = """
pattern_seed = 7
[camera]
truth = "truth.npz"
position = ["2 m", "-1 m", "1.3 m"]
angle_of_view = "59 deg"
[projector]
position = ["3 m", "-1 m", "1.3 m"]
width_px = 1920
height_px = 1200
angle_of_view = "40 deg"
url = "pjlink://192.168.0.20"
[[view]]
name = "right"
wall = "x_max"
kind = "v4l2"
device = "/dev/video2"
width_px = 1920
height_px = 1200
distance = "4 m"
pattern_seed = 1
[view.projector]
width_px = 1920
[[light]]
name = "projector 2"
camera_of = "right"
position = ["1 m", "2 m", "1.3 m"]
width_px = 1920
height_px = 1200
angle_of_view = "40 deg"
url = "pjlink://192.168.0.21"
pattern_seed = 2
[[supply]]
speed = "0.28 m/s"
[[outlet]]
flow = "60 m3/h"
[[wall]]
wall = "z_min"
adiabatic = true
[[object]]
kind = "box"
position = ["2.5 m", "1.5 m", "0 m"]
size = ["0.6 m", "0.4 m", "0.5 m"]
heat = "40 W"
heat_deviation = "10 W"
[[object]]
kind = "cabinet"
position = ["1 m", "1.5 m", "0 m"]
temperature = "24 C"
[[anemometer]]
position = ["2 m", "1.5 m", "1.1 m"]
velocity = ["0.1 m/s", "0 m/s", "0 m/s"]
"""
_ENDINGS = {
    "_kg_m3": "kg/m3",
    "_m2_s2": "m2/s2",
    "_m3_s": "m3/s",
    "_m2_s": "m2/s",
    "_m_s": "m/s",
    "_rad": "rad",
    "_counts": "counts",
    "_px": "px",
    "_pa": "Pa",
    "_hz": "Hz",
    "_m": "m",
    "_w": "W",
    "_s": "s",
    "_k": "K",
    "_e": "electrons",
}
# Whose ranges are checked where they are used.
_CHECKED_BY = dict.fromkeys((WaveletPattern, DotPattern, CheckerPattern), make.check_pattern)
_HEAD = "| key | meaning | unit | range | default | example |\n| --- | --- | --- | --- | --- | --- |"
Range = tuple[float, float]


@dataclass
class Table:
    """One class: the places in the file where it may stand."""

    kind: Any
    places: list[str] = field(default_factory=list)


def reference() -> str:
    """The reference as Markdown."""
    parts = [
        "# Reference of experiment.toml and of the answers",
        "Made by `airlens schema --markdown` from the models; change it there. A table in double brackets may stand "
        "many times. Without a default a key is required; `-` is a key that may be left out. The example is a value, "
        "not advice; `below` is a table of its own.",
        "# experiment.toml",
        "SI units throughout; a name's ending says which. World: x to the right, y from the camera to the patterned "
        "wall, z up.",
        *_sections(ExperimentSettings, _experiments()),
        "# answers.toml",
        " ".join(["Answers of `airlens new`: every value in quotes with its unit beside it.", *_unit_list()]),
        *_sections(Answers, _answers()),
    ]
    return "\n\n".join(parts) + "\n"


def _sections(kind: Any, examples: list[Any]) -> Iterator[str]:
    found: dict[tuple[Any, str], Any] = {}
    for data in examples:
        _collect(kind, data, found)
    for table in tables(kind):
        told = inspect.getdoc(table.kind) or ""
        rows = [_row(table.kind, name, hint, found) for name, hint in _hints(table.kind).items()]
        yield "\n\n".join([f"## {', '.join(table.places)}", told, "\n".join([_HEAD, *rows])])


def tables(kind: Any) -> list[Table]:
    """Every class below `kind`, in the order in which it is met, each once."""
    found: dict[Any, Table] = {}

    def visit(one: Any, path: str, many: bool) -> None:
        known = found.setdefault(one, Table(one))
        shown = ("`[[{}]]`" if many else "`[{}]`").format(path) if path else "top of the file"
        tag = _tag(one)
        place = f'{shown} with `kind = "{tag}"`' if tag else shown
        if place not in known.places:
            known.places.append(place)
        for name, hint in _hints(one).items():
            for member in _members(hint):
                visit(member, f"{path}.{name}".strip("."), _is_many(hint))

    visit(kind, "", False)
    return list(found.values())


def _row(kind: Any, name: str, hint: Any, found: Mapping[tuple[Any, str], Any]) -> str:
    required, default = _default(kind, name)
    meaning = "Says which table this is." if name == "kind" and _tag(kind) else meanings(kind).get(name, "")
    written = _written(hint)
    if written is not None and isinstance(default, float):
        default = written.text(default)
    example = found.get((kind, name), None if required else default)
    shown = "" if required else _shown(default)
    cells = (f"`{name}`", meaning, _unit(name, hint), _range(kind, name, hint), shown, _shown(example))
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"


@cache
def meanings(kind: Any) -> dict[str, str]:
    """What the text below each field says."""
    schema = TypeAdapter(kind).json_schema()
    own = schema.get("properties") or schema["$defs"][kind.__name__]["properties"]
    return {name: entry.get("description", "") for name, entry in own.items()}


def _default(kind: Any, name: str) -> tuple[bool, Any]:
    if issubclass(kind, BaseModel):
        info = kind.model_fields[name]
        return info.default is PydanticUndefined, info.default
    found = next(f for f in dataclasses.fields(kind) if f.name == name)
    return found.default is dataclasses.MISSING, found.default


def _shown(value: Any) -> str:
    if value is None or value == ():
        return "-"
    if dataclasses.is_dataclass(value) or isinstance(value, BaseModel | dict):
        return "below"
    if isinstance(value, bool):
        return f"`{str(value).lower()}`"
    if isinstance(value, str):
        return f'`"{value}"`'
    if isinstance(value, float):
        return f"`{value:.6g}`"
    if isinstance(value, list | tuple):
        return "below" if value and isinstance(value[0], dict) else f"`[{', '.join(map(_bare, value))}]`"
    return f"`{value}`"


def _bare(value: Any) -> str:
    return _shown(value).strip("`")


def _unit(name: str, hint: Any) -> str:
    written = _written(hint)
    if written is not None:
        return written.kind
    return next((unit for ending, unit in _ENDINGS.items() if name.endswith(ending)), "")


def _range(kind: Any, name: str, hint: Any) -> str:
    written = _written(hint)
    if written is not None:
        return written.range_text
    if _members(hint):
        return "tables" if _is_many(hint) else "table"
    named = list(_literals(hint))
    numbers = _bounds(kind, name) or _checked(kind).get(name) or _plain(hint)
    return ", ".join(part for part in (", ".join(f"`{_toml(one)}`" for one in named), numbers) if part)


def _plain(hint: Any) -> str:
    """A type in words, where no range is known."""
    if typing.get_origin(hint) in (typing.Union, types.UnionType):
        return ", ".join(dict.fromkeys(filter(None, map(_plain, typing.get_args(hint)))))
    if typing.get_origin(hint) is typing.Annotated:
        return _plain(typing.get_args(hint)[0])
    if typing.get_origin(hint) is tuple:
        return f"{len(typing.get_args(hint))} numbers"
    names = {str: "text", bool: "true or false", int: "whole number", float: "number"}
    return names.get(hint, "")


def _toml(value: Any) -> str:
    return f'"{value}"' if isinstance(value, str) else str(value)


def _literals(hint: Any) -> Iterator[Any]:
    if typing.get_origin(hint) is typing.Literal:
        yield from typing.get_args(hint)
    elif typing.get_origin(hint) in (typing.Union, types.UnionType, typing.Annotated):
        for one in typing.get_args(hint):
            yield from _literals(one)


def _written(hint: Any) -> Written | None:
    if isinstance(hint, Written):
        return hint
    return next((w for one in typing.get_args(hint) if (w := _written(one)) is not None), None)


def _bounds(kind: Any, name: str) -> str:
    """The limits of a pydantic field."""
    if not issubclass(kind, BaseModel):
        return ""
    words = {"ge": "{:g}", "gt": "above {:g}", "le": "to {:g}", "lt": "below {:g}"}
    limits = [
        text.format(getattr(one, limit))
        for limit, text in words.items()
        for one in _metadata(kind.model_fields[name])
        if getattr(one, limit, None) is not None
    ]
    return " ".join(limits)


def _metadata(info: Any) -> Iterator[Any]:
    yield from info.metadata
    for one in typing.get_args(info.annotation):
        for inner in getattr(one, "__metadata__", ()):
            yield from getattr(inner, "metadata", [inner])


def _checked(kind: Any) -> dict[str, str]:
    """The ranges that a setting checks itself against, read from its source."""
    functions = [getattr(kind, "__post_init__", None), _CHECKED_BY.get(kind)]
    found: dict[str, str] = {}
    for function in filter(None, functions):
        tree = ast.parse(textwrap.dedent(inspect.getsource(function)))
        loops = {
            loop.target.id: loop.iter.attr
            for loop in ast.walk(tree)
            if isinstance(loop, ast.For)
            and isinstance(loop.target, ast.Name)
            and isinstance(loop.iter, ast.Attribute)
        }
        for call in (node for node in ast.walk(tree) if isinstance(node, ast.Call)):
            bounds = _bounds_of(call, function.__module__)
            if bounds is not None and len(call.args) > 1:
                value = call.args[1]
                name = value.attr if isinstance(value, ast.Attribute) else loops.get(getattr(value, "id", ""))
                if name:
                    found[name] = "{:g} to {:g}".format(*bounds)
    return found


def _bounds_of(call: ast.Call, module: str) -> Range | None:
    """The two limits of a call of `check_range`, or of a function that calls it with limits of its own."""
    name = getattr(call.func, "id", "")
    if name == "check_range":
        try:
            return ast.literal_eval(call.args[2]), ast.literal_eval(call.args[3])
        except ValueError:
            return None
    if "check_" not in name:
        return None
    inner = ast.parse(textwrap.dedent(inspect.getsource(getattr(sys.modules[module], name))))
    calls = [node for node in ast.walk(inner) if isinstance(node, ast.Call)]
    return next((b for one in calls if (b := _bounds_of(one, module)) is not None), None)


def _hints(kind: Any) -> dict[str, Any]:
    return {
        name: hint
        for name, hint in typing.get_type_hints(kind, include_extras=True).items()
        if not name.startswith(("_", "model_"))
    }


def _members(hint: Any) -> list[Any]:
    """The classes that a hint names, as tables."""
    if isinstance(hint, type) and (issubclass(hint, BaseModel) or dataclasses.is_dataclass(hint)):
        return [hint]
    origin = typing.get_origin(hint)
    if origin in (typing.Union, types.UnionType, tuple, typing.Annotated):
        return [one for part in typing.get_args(hint) for one in _members(part)]
    return []


def _is_many(hint: Any) -> bool:
    return typing.get_origin(hint) is tuple


def _tag(kind: Any) -> str:
    """The `kind` that tells this class from the others of a union."""
    choices = typing.get_args(_hints(kind).get("kind"))
    return choices[0] if len(choices) == 1 else ""


def _collect(kind: Any, data: Any, found: dict[tuple[Any, str], Any]) -> None:
    """The first value of every key."""
    hints = _hints(kind)
    for name, value in data.items():
        if value is None or name not in hints:
            continue
        found.setdefault((kind, name), value)
        members = _members(hints[name])
        for item in value if isinstance(value, list) else [value]:
            chosen = [m for m in members if _tag(m) in ("", isinstance(item, dict) and item.get("kind"))]
            if isinstance(item, dict) and chosen:
                _collect(chosen[0], item, found)


def _experiments() -> list[Any]:
    made = [to_plain(settings_of(from_toml(template(n), Answers, n))) for n in TEMPLATES]
    return [*made, tomllib.loads(_MORE), tomllib.loads(_VISION)]


def _answers() -> list[Any]:
    return [*(tomllib.loads(template(name)) for name in TEMPLATES), tomllib.loads(_MORE_ANSWERS)]


def _unit_list() -> Iterator[str]:
    for kind, units in UNITS.items():
        yield f"{kind[:1].upper()}{kind[1:]}: {', '.join(units)}."
