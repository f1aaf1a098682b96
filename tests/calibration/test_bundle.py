import json

import pytest

from calibration.bundle import (
    Bundle,
    CalibratedOptics,
    Quality,
    from_json,
    given_bundle,
    to_json,
)
from calibration.errors import BundleError
from core.geometry import looking_along_y
from core.scene import CameraNoise

DATE = "2026-03-01T12:00:00+00:00"


def simulated() -> Bundle:
    camera = looking_along_y(position_m=(0.0, -2.0, 1.2), width_px=64, height_px=48, focal_px=90.0)
    projector = looking_along_y(position_m=(0.4, -2.0, 1.2), width_px=80, height_px=60, focal_px=110.0)
    return given_bundle(
        date=DATE,
        cameras={"camera": camera},
        projector=projector,
        noise={"camera": CameraNoise()},
        back_wall_y_m=1.5,
    )


def test_a_bundle_survives_text_exactly():
    bundle = simulated()
    covariance = tuple(tuple(0.1 * i * j for j in range(15)) for i in range(15))
    bundle = bundle.with_camera(
        CalibratedOptics(
            "camera",
            bundle.camera().optics,
            covariance,
            None,
            Quality("measured", 0.1, 9, 0.8, ("Retake 3.",)),
        )
    )

    assert from_json(to_json(bundle)) == bundle


def test_a_given_response_hands_its_noise_back():
    noise = CameraNoise(full_well_e=9_000.0, read_noise_e=2.5, dark_counts=16.0, bits=10)
    bundle = given_bundle(date=DATE, cameras={}, noise={"camera": noise})

    response = bundle.response("camera")

    assert response is not None
    assert response.noise == noise
    # Full well fills the scale above the dark level.
    assert response.dark_counts + response.gain_counts_per_e * noise.full_well_e == pytest.approx(1023)


@pytest.mark.parametrize(
    ("path", "value", "named"),
    [
        (("cameras", 0, "opticks"), 1, "Did you mean 'optics'"),
        (("wall", "normal"), [0, 1], r"bundle.json.wall.normal is \[0, 1\]; expected a list of 3"),
        (("wall", "flatness_rms_m"), "0.1", "expected a finite number"),
        (("wall", "points"), True, "expected a whole number"),
        (("projector", "optics", "width_px"), 0, "at least 1 x 1 px"),
        (("cameras", 0, "quality", "source"), "guessed", "expected one of 'given', 'measured'"),
        (("schema",), 99, "schema 99"),
        (("date",), "yesterday", "ISO 8601"),
        (("cameras", 0, "covariance"), [[1.0]], "not 15 x 15"),
    ],
)
def test_a_damaged_bundle_is_named_by_place_and_expectation(path, value, named):
    content = json.loads(to_json(simulated()))
    place = content
    for key in path[:-1]:
        place = place[key]
    place[path[-1]] = value

    with pytest.raises(BundleError, match=named):
        from_json(json.dumps(content))


def test_a_missing_key_and_text_that_is_not_json_are_refused():
    content = json.loads(to_json(simulated()))
    del content["date"]
    with pytest.raises(BundleError, match="lacks the key 'date'"):
        from_json(json.dumps(content))
    with pytest.raises(BundleError, match="is not JSON"):
        from_json("{")


def test_a_missing_camera_says_which_command_makes_one():
    with pytest.raises(BundleError, match="airlens calibrate camera"):
        Bundle(date=DATE).camera()
