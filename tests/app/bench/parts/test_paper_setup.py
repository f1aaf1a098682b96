"""The paper's simulated measurement: where it stands, and what its pictures hold of the air."""

from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest

from app.bench.parts.paper_setup import paper_problem
from app.volume.file import read_volume
from app.volume.measurement import fine_field
from core.losses.shifts import ShiftLoss
from core.scene import ProjectedPattern
from core.solve.nondimensional import frame_of
from core.solve.regime import DataModel, image_loss

VOLUME = read_volume(Path(str(files("app.simulate.sample") / "room.npz")))


def test_the_pictures_fill_the_frame_and_are_those_of_the_stated_air():
    problem = paper_problem(VOLUME, seed=0, image_std=1e-9)
    scene, picture = problem.scene, problem.images[0].reference_image
    assert isinstance(scene.light, ProjectedPattern)
    camera = scene.views[0].camera
    aside = np.subtract(scene.light.projector.position_m, camera.position_m)
    assert aside == pytest.approx([1.0, 0.0, 0.0])
    assert scene.room.upper_m[1] - camera.position_m[1] == pytest.approx(30.5)
    size = scene.room.size_m
    # The wall's share of a square picture that it fills but for a border of 3 % on each side.
    assert (picture > 0).mean() == pytest.approx(
        min(size[0], size[2]) / max(size[0], size[2]) / 1.06**2, abs=0.03
    )

    truth = fine_field(VOLUME, scene).values
    loss = image_loss(problem, frame_of(problem), 1.0, DataModel(), truth.shape)
    assert isinstance(loss, ShiftLoss)
    rows = loss.views[0]
    left = np.asarray(rows.errors(truth, None))
    # Straight rays, exact through the cells, against bent ones in steps: 0.10.
    assert np.linalg.norm(left) < 0.2 * np.linalg.norm(rows.target)
