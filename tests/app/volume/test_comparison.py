"""A reading that the result leaves is told, before the answer."""

from dataclasses import replace

import numpy as np

from app.experiment.folder import ExperimentSettings, create_experiment
from app.files.durable import make_folder, write_text
from app.report.doubts import doubts
from app.volume.comparison import left_thermometers
from core.scene import FixedTexture, PointSensors, Scene
from tests.app.report.test_indoor import ROOM, VIEW, layered

# Half a metre and one metre up the air has 296 and 297 K; the last entry is no temperature.
TABLE = (
    "x,y,z,T,T_std,u,v,w\n2,1.5,0.5,296.4,0.2,,,\n2,1.5,1,301,0.5,,,\n1,1,1,297.9,0.2,,,\n1,1,1.5,,,1,0,0\n"
)


def test_thermometers_that_the_result_leaves_are_told_the_farthest_first(tmp_path):
    sensors = PointSensors(file="boundary/sensors.csv")
    scene = Scene(room=ROOM, views=(VIEW,), light=FixedTexture(), boundary=(sensors,))
    experiment = create_experiment(tmp_path / "one", ExperimentSettings(scene=scene))
    make_folder(experiment.folder / "boundary")
    write_text(experiment.folder / "boundary" / "sensors.csv", TABLE)

    told = left_thermometers(experiment, layered())

    assert told == (
        "The thermometer at (2.00, 1.50, 1.00) m reads 27.9 °C; the result has 23.9 °C there, which is 8.0 "
        "times as far as the reading and the result may be off (one deviation). Check that thermometer.",
        "The thermometer at (1.00, 1.00, 1.00) m reads 24.8 °C; the result has 23.9 °C there, which is 4.5 "
        "times as far as the reading and the result may be off (one deviation). Check that thermometer.",
    )
    # A result that is itself unsure to half a kelvin is left by one of them alone.
    unsure = replace(layered(), temperature_std_k=np.full_like(layered().temperature_k, 0.5))
    assert ["27.9" in sentence for sentence in left_thermometers(experiment, unsure)] == [True]
    assert doubts(["nothing", *told]) == told
