"""What a person writes, to SI."""

import pytest

from app.setup.units import to_si


@pytest.mark.parametrize(
    ("text", "kind", "si"),
    [
        ("2.7 m", "length", 2.7),
        ("45cm", "length", 0.45),
        ("3.45 um", "length", 3.45e-6),
        ("18 C", "temperature", 291.15),
        ("-3 °C", "temperature", 270.15),
        ("64.4 F", "temperature", 291.15),
        ("291.15 K", "temperature", 291.15),
        ("0.9 F", "temperature difference", 0.5),
        ("120 m3/h", "volume flow", 120 / 3600),
        ("20 l/s", "volume flow", 0.02),
        ("100 cfm", "volume flow", 0.0471947),
        ("1e2 fpm", "speed", 0.508),
        ("20 ms", "time", 0.02),
        ("5 %", "share", 0.05),
    ],
)
def test_a_number_with_its_unit(text, kind, si):
    assert to_si(text, kind) == pytest.approx(si, rel=1e-6)


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("18", "has no unit"),
        (18, "in quotes"),
        ("", "it is empty; expected a number and its unit"),
        ("18,5 C", "has a comma; write '18.5 C'"),
        ("-2,5", "has a comma; write '-2.5'"),
        ("1,200.5 C", "no temperature"),
        ("18 R", "no unit of temperature"),
        ("warm", "no temperature"),
    ],
)
def test_what_is_no_temperature_is_said(text, why):
    with pytest.raises(ValueError, match=why):
        to_si(text, "temperature")
