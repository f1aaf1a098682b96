"""What people in the air would say of it: draught, warmth, and how evenly the air is spread.

    DR  = (34 - t) (v - 0.05)^0.62 (0.37 v Tu + 3.14)                ISO 7730:2005, equation 6
    EDT = (t - t_mean) - 8 (v - 0.15)                                ASHRAE 113
    PMV = (0.303 exp(-0.036 M) + 0.028) L(M, t, t_r, v, humidity, clothing)       ISO 7730:2005, annex D
    PPD = 100 - 95 exp(-0.03353 PMV^4 - 0.2179 PMV^2)                ISO 7730:2005, equation 5

with t in degrees Celsius, v in m/s, Tu in percent and M in W/m2; everything here takes kelvin and shares, and works
on whole volumes at once. The speed is that of the mean flow; a body's own movement is not added to it.
"""

import numpy as np
from jaxtyping import Float

from core.setting import check_range, setting

CELSIUS_K = 273.15
# ISO 7730:2005, 6.2: what may be taken for mixing ventilation where nobody measured it.
TURBULENCE_INTENSITY = 0.4
# ASHRAE 113: a place is comfortable between these effective draught temperatures, below this speed.
COMFORTABLE_EDT_K = (-1.7, 1.1)
COMFORTABLE_M_S = 0.35
# Steps of the clothing's temperature; each halves the change, and 40 leave nothing of it.
_STEPS = 40

Field = Float[np.ndarray, "*shape"]


@setting
class Occupant:
    """Who is in the room, and how humid it is: clothing [clo], activity [met], relative humidity as a share."""

    clothing_clo: float = 0.7
    activity_met: float = 1.2
    relative_humidity: float = 0.5

    def __post_init__(self) -> None:
        check_range(
            "Clothing", self.clothing_clo, 0.0, 2.0, "clo", "Light summer clothes have 0.5, a suit 1.0."
        )
        check_range(
            "Activity", self.activity_met, 0.8, 4.0, "met", "Sitting is 1.0, office work 1.2, standing 1.6."
        )
        check_range("Relative humidity", self.relative_humidity, 0.0, 1.0, "", "It is a share (50 % is 0.5).")


def draught_rate_percent(
    temperature_k: Field, speed_m_s: Field, turbulence: float = TURBULENCE_INTENSITY
) -> Field:
    """Share of people whom the air bothers by its draught [%], 0 to 100.

    ISO 7730:2005, equation 6, for sitting people and air of 20 to 26 degrees; none below 0.05 m/s or above 34
    degrees. `turbulence` is the turbulence intensity as a share.
    """
    cold_k = np.maximum(34.0 - (temperature_k - CELSIUS_K), 0.0)
    moving = np.maximum(speed_m_s - 0.05, 0.0) ** 0.62
    return np.minimum(cold_k * moving * (0.37 * speed_m_s * 100.0 * turbulence + 3.14), 100.0)


def effective_draught_temperature_k(
    temperature_k: Field, speed_m_s: Field, mean_temperature_k: float
) -> Field:
    """How much warmer (or, below zero, colder) the air feels than the mean of the zone, still air being 0.15 m/s."""
    return temperature_k - mean_temperature_k - 8.0 * (speed_m_s - 0.15)


def air_diffusion_performance_percent(temperature_k: Field, speed_m_s: Field) -> float:
    """Air diffusion performance index of these places [%]: the share of them that is comfortable (ASHRAE 113)."""
    felt_k = effective_draught_temperature_k(temperature_k, speed_m_s, float(np.mean(temperature_k)))
    low_k, high_k = COMFORTABLE_EDT_K
    return 100.0 * float(np.mean((felt_k > low_k) & (felt_k < high_k) & (speed_m_s < COMFORTABLE_M_S)))


def predicted_mean_vote(
    temperature_k: Field, speed_m_s: Field, occupant: Occupant, radiant_k: Field | None = None
) -> Field:
    """Mean vote of many people, -3 (cold) to 3 (hot): ISO 7730:2005, annex D.

    `radiant_k` is the mean radiant temperature; the air's own where it is None. The standard holds for air of 10 to
    30 degrees, below 1 m/s, votes within -2 to 2.
    """
    air_c = np.asarray(temperature_k, np.float64) - CELSIUS_K
    radiant_c = air_c if radiant_k is None else np.asarray(radiant_k, np.float64) - CELSIUS_K
    speed = np.asarray(speed_m_s, np.float64)
    vapour_pa = 1000.0 * occupant.relative_humidity * np.exp(16.6536 - 4030.183 / (air_c + 235.0))
    insulation = 0.155 * occupant.clothing_clo
    metabolism = 58.15 * occupant.activity_met
    area = 1.0 + 1.29 * insulation if insulation <= 0.078 else 1.05 + 0.645 * insulation
    clothing_k, convection = _clothing(air_c, radiant_c, speed, insulation, area, metabolism)
    losses = (
        3.05e-3 * (5733.0 - 6.99 * metabolism - vapour_pa)  # through the skin
        + max(0.42 * (metabolism - 58.15), 0.0)  # sweat
        + 1.7e-5 * metabolism * (5867.0 - vapour_pa)  # breath, latent
        + 0.0014 * metabolism * (34.0 - air_c)  # breath, dry
        + 3.96 * area * (_fourth(clothing_k / 100.0) - _fourth((radiant_c + 273.0) / 100.0))
        + area * convection * (clothing_k - 273.0 - air_c)
    )
    return (0.303 * np.exp(-0.036 * metabolism) + 0.028) * (metabolism - losses)


def predicted_dissatisfied_percent(vote: Field) -> Field:
    """Share of people who would call the room too warm or too cold [%], from 5 upwards."""
    square = np.square(vote)
    return 100.0 - 95.0 * np.exp(-0.03353 * np.square(square) - 0.2179 * square)


def _clothing(
    air_c: Field, radiant_c: Field, speed_m_s: Field, insulation: float, area: float, metabolism: float
) -> tuple[Field, Field]:
    """Surface temperature of the clothes [K] and the coefficient of convection [W/m2/K], by annex D's iteration.

    Its kelvin is 273 above Celsius.
    """
    air_k, covered = air_c + 273.0, insulation * area
    fixed = 308.7 - 0.028 * metabolism + 3.96 * covered * _fourth((radiant_c + 273.0) / 100.0)
    forced = 12.1 * np.sqrt(speed_m_s)
    now = (air_k + (35.5 - air_c) / (3.5 * (6.45 * insulation + 0.1))) / 100.0
    convection = forced
    for _ in range(_STEPS):
        convection = np.maximum(forced, 2.38 * np.sqrt(np.sqrt(np.abs(100.0 * now - air_k))))
        found = (fixed + covered * air_k * convection - 3.96 * covered * _fourth(now)) / (
            100.0 + 100.0 * covered * convection
        )
        change = found - now
        now = now + 0.5 * change
        if np.all(np.abs(change) < 1e-6):
            break
    return 100.0 * now, convection


def _fourth(value: Field) -> Field:
    return np.square(np.square(value))
