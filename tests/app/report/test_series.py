"""A sequence as ParaView's collection: one volume a burst, with its time."""

import zipfile
from xml.etree import ElementTree

import numpy as np
import pytest
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkIOXML import vtkXMLImageDataReader

from app.errors import BadInputError
from app.report.series import write_series
from tests.app.experiment.test_results import SHAPE, solution, with_bursts


def read(path, name):
    reader = vtkXMLImageDataReader()
    reader.SetFileName(str(path))
    reader.Update()
    image = reader.GetOutput()
    assert image.GetDimensions() == SHAPE
    return vtk_to_numpy(image.GetPointData().GetArray(name)).reshape(SHAPE, order="F")


def test_each_burst_is_a_volume_at_its_time(tmp_path):
    whole = with_bursts()
    write_series(tmp_path / "bursts.zip", whole)
    with zipfile.ZipFile(tmp_path / "bursts.zip") as packed:
        packed.extractall(tmp_path)
    sets = ElementTree.parse(tmp_path / "bursts.pvd").getroot().findall("./Collection/DataSet")
    assert [float(one.attrib["timestep"]) for one in sets] == [0.0, 6.0, 12.0]
    for one, departure_k in zip(sets, whole.departures.temperature_k, strict=True):
        path = tmp_path / one.attrib["file"]
        np.testing.assert_allclose(read(path, "T"), whole.temperature_k + departure_k, rtol=1e-6)
        np.testing.assert_array_equal(read(path, "T_departure"), departure_k)
        std_k = np.hypot(whole.temperature_std_k, whole.departures.temperature_std_k)
        np.testing.assert_allclose(read(path, "T_std"), std_k, rtol=1e-6)


def test_a_result_without_bursts_says_how_to_get_them(tmp_path):
    with pytest.raises(BadInputError, match="--sequence"):
        write_series(tmp_path / "bursts.zip", solution())
