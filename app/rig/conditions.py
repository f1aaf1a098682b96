"""How warm the room was and how long the devices had been on: what a calibration and a capture must share."""

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from app.experiment.folder import ExperimentSettings
from app.rig.projectors import lamp_journal
from drivers.projector.lamp_guard import LampGuard


@dataclass(frozen=True)
class Conditions:
    """None where nobody knows."""

    ambient_temperature_k: float | None = None
    minutes_on: float | None = None


UNTOLD = Conditions()


def conditions_of(settings: ExperimentSettings | None, told: Conditions) -> Conditions:
    """What the operator tells; else the scene's air, and how long ago the rig's lamp was lit, of several the last."""
    if settings is None:
        return told
    ambient_k, minutes = told.ambient_temperature_k, told.minutes_on
    if ambient_k is None:
        ambient_k = settings.scene.air.ambient_temperature_k
    if minutes is None:
        lit_s = [LampGuard(journal=lamp_journal(url)).on_s for url in settings.rig.projector_urls]
        minutes = min((one / 60 for one in lit_s if one is not None), default=None)
    return Conditions(ambient_k, minutes)


def seconds_on(settings: ExperimentSettings | None, told: Conditions) -> float | None:
    """How long the rig has been on [s], where anybody knows."""
    minutes = conditions_of(settings, told).minutes_on
    return None if minutes is None else 60 * minutes


def known_pairs(conditions: Conditions) -> dict[str, float]:
    """What is known, by the names that flags, requests, manifests and bundles share."""
    return {name: value for name, value in dataclasses.asdict(conditions).items() if value is not None}


def conditions_in(content: Mapping[str, Any]) -> Conditions:
    """What `known_pairs` wrote."""
    return Conditions(content.get("ambient_temperature_k"), content.get("minutes_on"))
