"""The surface of one temperature, against a sphere; paths as another program reads them."""

import struct

import numpy as np
import pytest
import vtk

from app.errors import BadInputError
from app.report.paths import write_vtu
from app.report.surface import middle_level_k, write_ply
from core.result import Solution

CENTRE_M = np.array([1.0, 0.9, 1.1])


def ball(cells=40):
    """Air whose temperature falls by 10 K a metre from a point, in a wind along x."""
    axes = [np.linspace(0.0, 2.0, cells + 1, dtype=np.float32) for _ in range(3)]
    points_m = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    away_m = np.linalg.norm(points_m - CENTRE_M, axis=-1)
    wind = np.broadcast_to(np.float32([0.5, 0.0, 0.0]), points_m.shape)
    return Solution(*axes, temperature_k=(300.0 - 10.0 * away_m).astype(np.float32), velocity_m_s=wind)


def read_ply(content):
    head, _, body = content.partition(b"end_header\n")
    words = head.split()
    vertices = int(words[words.index(b"vertex") + 1])
    faces = int(words[words.index(b"face") + 1])
    points = np.frombuffer(body, "<f4", 3 * vertices).reshape(-1, 3)
    rows = [struct.unpack_from("<B3i", body, 12 * vertices + 13 * index) for index in range(faces)]
    assert len(body) == 12 * vertices + 13 * faces
    assert {row[0] for row in rows} == {3}
    return points, np.array([row[1:] for row in rows])


def test_the_surface_of_a_ball_is_a_sphere_where_it_stands(tmp_path):
    write_ply(tmp_path / "ball.ply", ball(), 294.0)
    points_m, faces = read_ply((tmp_path / "ball.ply").read_bytes())

    radii_m = np.linalg.norm(points_m - CENTRE_M, axis=1)
    # Along an edge of 50 mm the distance from the centre bends by at most 0.5 mm at 0.6 m.
    np.testing.assert_allclose(radii_m, 0.6, atol=1.1e-3)
    a, b, c = (points_m[faces[:, corner]] for corner in range(3))
    area_m2 = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum()
    assert area_m2 == pytest.approx(4 * np.pi * 0.6**2, rel=0.01)


def test_the_level_is_half_way_to_the_extreme_unless_it_is_given(tmp_path):
    # The mean is 291 K, the farthest from it 294 K.
    assert middle_level_k(np.array([290.0, 290.0, 290.0, 294.0])) == pytest.approx(292.5)
    with pytest.raises(BadInputError, match="Give one between"):
        write_ply(tmp_path / "none.ply", ball(4), 400.0)


def test_paths_carry_how_long_each_particle_stayed(tmp_path):
    write_vtu(tmp_path / "paths.vtu", ball(4))

    reader = vtk.vtkXMLUnstructuredGridReader()
    reader.SetFileName(str(tmp_path / "paths.vtu"))
    reader.Update()
    grid = reader.GetOutput()
    stayed_s = grid.GetCellData().GetArray("residence_s")
    first_m = grid.GetPoint(grid.GetCell(0).GetPointId(0))
    assert grid.GetNumberOfCells() == 5 * 4 * 5
    # The first starts a tenth of the room from the side that the wind comes from.
    assert first_m[0] == pytest.approx(0.2)
    assert stayed_s.GetTuple1(0) == pytest.approx((2.0 - 0.2) / 0.5, rel=1e-6)


def test_without_velocity_paths_are_refused_with_what_to_do(tmp_path):
    known = ball(4)
    without = Solution(known.x_m, known.y_m, known.z_m, known.temperature_k)
    with pytest.raises(BadInputError, match="standard"):
        write_vtu(tmp_path / "paths.vtu", without)
