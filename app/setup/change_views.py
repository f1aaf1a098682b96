"""Other answers about cameras and projectors, for the views of a scene and the devices of its rig."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from app.experiment.rig_settings import RigSettings
from app.setup.answers import FIRST, Answers
from app.setup.merge import merged, merged_list, sources
from core.scene import Scene, View


def changed_views(
    old: Scene, asked: View, told: tuple[Answers, Answers], made: tuple[Scene, Scene]
) -> tuple[View, ...]:
    """The view that `camera` answers, and the others as answers tell them: these where it is the first."""
    first = merged(asked, made[0].views[0], made[1].views[0])
    if asked is not old.views[0]:
        return tuple(first if one is asked else one for one in old.views)
    olds = [one for one in old.views if one.camera_of is None]
    source = sources(told[0].view, told[1].view)
    before, after = (
        scene.views[1 : 1 + len(answers.view)] for scene, answers in zip(made, told, strict=True)
    )
    cameras = (first, *merged_list(olds[1:], source, before, after))
    called = {olds[was + 1].name: cameras[now + 1].name for now, was in source.items()} | {
        first.name: first.name
    }
    lights = _lights(old, cameras, called, told, made)
    # Each in its place among the old ones; more are last.
    further, turns = iter(cameras), iter(lights)
    placed = [next(further if one.camera_of is None else turns, None) for one in old.views]
    return (*(one for one in placed if one is not None), *further, *turns)


def _lights(
    old: Scene,
    cameras: Sequence[View],
    called: dict[str, str],
    told: tuple[Answers, Answers],
    made: tuple[Scene, Scene],
) -> list[View]:
    """The views under further projectors; one that comes to a camera has what that camera's own view has.

    `called`: what each camera of before is called now.
    """
    olds = [one for one in old.views if one.camera_of is not None]
    owners = {one.name: one for one in cameras} | {FIRST: cameras[0]}
    source = sources(told[0].light, told[1].light)
    before, after = (scene.views[1 + len(one.view) :] for scene, one in zip(made, told, strict=True))
    found = []
    for number, view in enumerate(merged_list(olds, source, before, after)):
        owner = owners[after[number].camera_of or FIRST]
        stays = number in source and called.get(olds[source[number]].camera_of or "") == owner.name
        if stays:
            found.append(view)
        else:
            found.append(replace(owner, name=view.name, camera_of=owner.name, light=view.light))
    return found


def changed_rig(
    old: RigSettings, told: tuple[Answers, Answers], made: tuple[RigSettings, RigSettings]
) -> RigSettings:
    """The devices; a further camera or projector keeps its own whatever it is called now."""
    was: dict[str, str] = {}
    for before, after in ((told[0].view, told[1].view), (told[0].light, told[1].light)):
        source = sources(before, after)
        was |= {one.name: before[source[n]].name if n in source else "" for n, one in enumerate(after)}
    gone = {one.name for one in (*told[0].view, *told[0].light)}
    named = {
        table: _named([dict(getattr(one, table) or {}) for one in (old, *made)], was, gone)
        for table in ("cameras", "projectors")
    }
    return merged(old, *made).model_copy(update=named)


def _named(tables: list[dict[str, Any]], was: dict[str, str], gone: set[str]) -> dict[str, Any] | None:
    """What the rig names by views; `was` has what each was called before, `gone` all that were answered before."""
    kept, before, after = tables
    found = {name: device for name, device in kept.items() if name not in gone}
    for name, earlier in was.items():
        device = merged(kept.get(earlier), before.get(earlier), after.get(name))
        if device is not None:
            found[name] = device
    return found or None
