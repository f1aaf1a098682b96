import dataclasses

from calibration.age import warnings_for
from calibration.bundle import given_bundle
from tests.calibration.practice import rig

DATE = "2026-03-01T12:00:00+00:00"


def bundle_of():
    camera, projector = rig(0.05)
    return given_bundle(date=DATE, cameras={"camera": camera}, projector=projector, back_wall_y_m=3.0)


def test_old_and_warm_calibrations_are_warned_of():
    bundle = bundle_of()
    assert warnings_for(bundle, "2026-03-02T12:00:00+00:00") == ()
    assert "20 days older" in warnings_for(bundle, "2026-03-21T12:00:00+00:00")[0]
    # Pictures that were taken long before somebody moved the rig and calibrated it.
    assert "20 days newer" in warnings_for(bundle, "2026-02-09T12:00:00+00:00")[0]

    warm = dataclasses.replace(bundle, ambient_temperature_k=293.0, minutes_on=60.0)
    found = warnings_for(warm, DATE, ambient_temperature_k=298.0, minutes_on=5.0)
    assert "+5.0 K" in found[0]
    assert "settle in 20" in found[1]
