"""How old a calibration is, and whether it was made in the conditions of the capture that it is used for."""

import datetime as dt

from calibration.bundle import Bundle

# Lamps and lenses settle within half an hour; a camera's centre moves by some 0.1 px per kelvin.
OLD_DAYS = 7.0
WARM_K = 3.0
WARM_UP_MINUTES = 20.0


def warnings_for(
    bundle: Bundle,
    captured: str,
    ambient_temperature_k: float | None = None,
    minutes_on: float | None = None,
) -> tuple[str, ...]:
    """Why a capture of that moment (ISO 8601) and those conditions may not fit this calibration."""
    made, taken = (dt.datetime.fromisoformat(text) for text in (bundle.date, captured))
    days = (taken - made).total_seconds() / 86400
    found = []
    if abs(days) > OLD_DAYS:
        found.append(
            f"The calibration is {abs(days):.0f} days {'older' if days > 0 else 'newer'} than the capture."
        )
    if ambient_temperature_k is not None and bundle.ambient_temperature_k is not None:
        change_k = ambient_temperature_k - bundle.ambient_temperature_k
        if abs(change_k) > WARM_K:
            found.append(f"The room is {change_k:+.1f} K against the calibration.")
    if minutes_on is not None and bundle.minutes_on is not None:
        if min(minutes_on, bundle.minutes_on) < WARM_UP_MINUTES < max(minutes_on, bundle.minutes_on):
            found.append(
                f"The devices had been on for {bundle.minutes_on:.0f} minutes at the calibration and for "
                f"{minutes_on:.0f} at the capture; they settle in {WARM_UP_MINUTES:.0f}."
            )
    return tuple(f"{text} Check it by a drift measurement, or calibrate again." for text in found)
