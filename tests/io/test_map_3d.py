"""Maps in space from files: grids, PLY and PCD, whole and cut short."""

import struct

import numpy as np
import pytest

from cloud_files import CLOUDS, POINTS, ply
from topobelief.errors import FileError
from topobelief.io.floor_plan import read_world
from topobelief.io.map_3d import read_world_3d
from topobelief.io.point_cloud import read_point_cloud


@pytest.mark.parametrize("name", CLOUDS)
def test_points_are_read(tmp_path, name):
    (tmp_path / name).write_bytes(CLOUDS[name])
    np.testing.assert_array_equal(read_point_cloud(tmp_path / name), POINTS)
    world = read_world_3d(tmp_path / name, resolution=0.5)
    assert not world.contains(POINTS).any()


@pytest.mark.parametrize("name", CLOUDS)
def test_a_file_cut_short_is_refused(tmp_path, name):
    (tmp_path / name).write_bytes(CLOUDS[name][:-9])
    with pytest.raises(FileError, match=r"cut short|expected the numbers"):
        read_point_cloud(tmp_path / name)


@pytest.mark.parametrize(
    ("name", "old", "new", "message"),
    [
        ("a.ply", b"ply\n", b"obj\n", "begins with the line ply"),
        ("a.ply", b"end_header", b"end", "ends with the line end_header"),
        ("a.ply", b"ascii", b"utf8", "expected the format ascii or"),
        ("a.ply", b"float x", b"float u", "x, y and z, got none with x"),
        ("a.ply", b"vertex 3", b"vertex 999999999", "cut short"),
        ("a.pcd", b"DATA ascii", b"DATA binary_compressed", "pcl_convert_pcd_ascii_binary"),
        ("a.pcd", b"SIZE 4 8", b"SIZE 8", "of the same length"),
        ("b.pcd", b"TYPE F", b"TYPE Q", "expected TYPE F, I or U"),
        ("b.pcd", b"POINTS 3", b"POINTS 9999999999999", "cut short"),
        ("b.pcd", b"WIDTH", b"BREADTH", "expected a PCD header with"),
    ],
)
def test_what_is_wrong_with_a_cloud_is_said(tmp_path, name, old, new, message):
    (tmp_path / name).write_bytes(CLOUDS[name].replace(old, new))
    with pytest.raises(FileError, match=message):
        read_point_cloud(tmp_path / name)


def test_a_signalling_nan_is_a_missing_point(tmp_path):
    data = ply("binary_little_endian").replace(struct.pack("<f", 3), b"\x01\x00\xa0\x7f")
    (tmp_path / "le.ply").write_bytes(data)
    assert np.isnan(read_point_cloud(tmp_path / "le.ply")).any(axis=1).tolist() == [False, True, False]


class TestGrids:
    @pytest.mark.parametrize(
        ("cells", "free"),
        [
            (np.array([False, True, True]), [True, False, False]),
            (np.array([0, 1, 1], dtype=np.uint8), [True, False, False]),
            (np.array([0, 100, -1], dtype=np.int8), [True, False, False]),
            (np.array([0.2, 0.9, np.nan]), [True, False, False]),
        ],
        ids=["bool", "0 and 1", "percent", "probability"],
    )
    def test_occupied_unknown_and_free(self, tmp_path, cells, free):
        np.save(tmp_path / "grid.npy", cells.reshape(3, 1, 1))
        world = read_world_3d(tmp_path / "grid.npy", resolution=2.0, origin=(1, 0, 0))
        assert world.contains([(2, 1, 1), (4, 1, 1), (6, 1, 1)]).tolist() == free
        assert world.corners.tolist() == [[1, 0, 0], [7, 2, 2]]

    def test_unknown_cells_may_be_free(self, tmp_path):
        np.save(tmp_path / "grid.npy", np.array([0, 100, -1]).reshape(3, 1, 1))
        world = read_world_3d(tmp_path / "grid.npy", resolution=1.0, unknown="free")
        assert world.contains([(2.5, 0.5, 0.5)]).all()

    @pytest.mark.parametrize(
        ("content", "message"),
        [
            (b"", "numpy.save"),
            (b"\x93NUMPY\x01\x00", "numpy.save"),
            (b"PK\x03\x04", "numpy.save"),
            ("flat", "shape"),
            ("text", "expected a grid of numbers"),
            ("object", "numpy.save"),
            ("huge", "numpy.save"),
        ],
    )
    def test_what_is_no_grid_is_refused(self, tmp_path, content, message):
        file = tmp_path / "grid.npy"
        if isinstance(content, bytes):
            file.write_bytes(content)
        elif content == "huge":
            np.save(file, np.zeros((2, 2, 2)))
            file.write_bytes(file.read_bytes().replace(b"(2, 2, 2), ", b"(9999999, 2, 2999), ")[:300])
        else:
            arrays = {"flat": np.zeros((2, 2)), "text": np.full((1, 1, 1), "a"), "object": np.full((1, 1, 1), None)}
            np.save(file, arrays[content], allow_pickle=True)
        with pytest.raises(FileError, match=message):
            read_world_3d(file, resolution=1.0)

    def test_a_resolution_is_needed_and_suffixes_are_told(self, tmp_path):
        np.save(tmp_path / "grid.npy", np.zeros((2, 2, 2)))
        with pytest.raises(FileError, match="give --resolution"):
            read_world_3d(tmp_path / "grid.npy")
        with pytest.raises(FileError, match=r"ends in .npy, .ply or .pcd, got .las"):
            read_world_3d(tmp_path / "cloud.las")
        with pytest.raises(FileError, match="a map in 3D"):
            read_world(tmp_path / "grid.npy")
        (tmp_path / "a.ply").write_bytes(CLOUDS["a.ply"])
        with pytest.raises(FileError, match="an origin for a grid"):
            read_world_3d(tmp_path / "a.ply", origin=(0, 0, 0))
