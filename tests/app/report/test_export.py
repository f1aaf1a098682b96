"""Velocity as other programs read it: each component along its own axis."""

import numpy as np
import vtk
from vtk.util.numpy_support import vtk_to_numpy

from app.report.volume_image import write_vti
from core.result import Solution

WIND_M_S = (0.5, -0.25, 0.125)


def test_a_wind_keeps_its_direction_in_vtk(tmp_path):
    axes = [np.linspace(0.0, 1.0, n, dtype=np.float32) for n in (3, 4, 5)]
    wind = np.broadcast_to(np.float32(WIND_M_S), (3, 4, 5, 3))
    air = Solution(*axes, temperature_k=np.full((3, 4, 5), 295.0, np.float32), velocity_m_s=wind)
    write_vti(tmp_path / "air.vti", air)
    reader = vtk.vtkXMLImageDataReader()
    reader.SetFileName(str(tmp_path / "air.vti"))
    reader.Update()
    found = vtk_to_numpy(reader.GetOutput().GetPointData().GetArray("velocity"))
    np.testing.assert_array_equal(found, np.broadcast_to(WIND_M_S, found.shape))
