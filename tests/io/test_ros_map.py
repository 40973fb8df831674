"""ROS maps: what each mode makes of a pixel, where the image lies, and one clear error for everything else."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from data_files import map_file
from topobelief.errors import FileError, InvalidInputError
from topobelief.io.ros_map import read_ros_map

HEADER = {
    "image": "map.png",
    "resolution": "0.5",
    "origin": "[0.0, 0.0, 0.0]",
    "negate": "0",
    "occupied_thresh": "0.65",
    "free_thresh": "0.25",
}
WHITE = np.full((2, 3), 255)


def write_map(folder: Path, pixels: np.ndarray = WHITE, **changes: str | None) -> Path:
    """A map with an image of 8-bit pixels, its header changed: a key that is None is left out."""
    fields = HEADER | changes
    Image.fromarray(pixels.astype(np.uint8)).save(folder / "map.png")
    path = folder / "map.yaml"
    path.write_text("".join(f"{key}: {value}\n" for key, value in fields.items() if value is not None))
    return path


def free_pixels(path: Path, unknown: str = "occupied") -> list[list[bool]]:
    """Whether the centre of each of 2 x 3 pixels is free, top row first."""
    rows, columns = np.indices((2, 3))
    centres = np.stack([columns.ravel() + 0.5, 1.5 - rows.ravel()], axis=1) * 0.5
    return read_ros_map(path, unknown=unknown).contains(centres).reshape(2, 3).tolist()


class TestPixels:
    def test_trinary_is_the_default(self, tmp_path: Path) -> None:
        """Occupied above p = 0.65, free below 0.25, and in between what the caller takes the unknown for."""
        path = write_map(tmp_path, np.array([[0, 80, 150], [200, 255, 254]]))
        assert free_pixels(path) == [[False, False, False], [True, True, True]]
        assert free_pixels(path, "free") == [[False, False, True], [True, True, True]]

    def test_scale_knows_every_opaque_pixel_and_parts_them_half_way(self, tmp_path: Path) -> None:
        """Half-way between the thresholds is p = 0.45, a value of 140.25."""
        path = write_map(tmp_path, np.array([[0, 139, 142], [255, 100, 150]]), mode="scale")
        expected = [[False, False, True], [True, False, True]]
        assert free_pixels(path) == expected
        assert free_pixels(path, "free") == expected

    def test_raw_pixels_are_percent_and_unknown_above_100(self, tmp_path: Path) -> None:
        path = write_map(tmp_path, np.array([[0, 49, 50], [100, 101, 255]]), mode="raw")
        assert free_pixels(path) == [[True, True, False], [False, False, False]]
        assert free_pixels(path, "free") == [[True, True, False], [False, True, True]]

    def test_negate_swaps_black_and_white(self, tmp_path: Path) -> None:
        for negate in ("1", "true"):
            path = write_map(tmp_path, np.array([[0, 0, 255], [255, 0, 255]]), negate=negate)
            assert free_pixels(path) == [[True, True, False], [False, True, False]]

    @pytest.mark.parametrize("mode", ["trinary", "scale"])
    def test_a_pixel_that_is_not_opaque_is_unknown(self, tmp_path: Path, mode: str) -> None:
        pixels = np.full((2, 3, 4), 255)
        pixels[0, 0, 3], pixels[1, 1, :3] = 128, 0
        path = write_map(tmp_path, pixels, mode=mode)
        assert free_pixels(path) == [[False, True, True], [True, False, True]]
        assert free_pixels(path, "free") == [[True, True, True], [True, False, True]]

    def test_colours_are_averaged(self, tmp_path: Path) -> None:
        pixels = np.full((2, 3, 3), 255)
        pixels[0, 0], pixels[0, 1] = (255, 0, 0), (255, 255, 150)
        assert free_pixels(write_map(tmp_path, pixels)) == [[False, True, True], [True, True, True]]

    def test_sixteen_bits_are_scaled(self, tmp_path: Path) -> None:
        path = write_map(tmp_path)
        Image.fromarray(np.array([[0, 65535, 60000], [30000, 65535, 0]], dtype=np.uint16)).save(tmp_path / "map.png")
        assert free_pixels(path) == [[False, True, True], [False, True, False]]

    def test_plain_and_binary_pgm_are_read(self, tmp_path: Path) -> None:
        path = write_map(tmp_path, image="map.pgm")
        (tmp_path / "map.pgm").write_text("P2\n# a comment\n3 2\n255\n0 255 255\n255 255 0\n")
        assert free_pixels(path) == [[False, True, True], [True, True, False]]
        (tmp_path / "map.pgm").write_bytes(b"P5\n3 2\n255\n" + bytes([0, 255, 255, 255, 255, 0]))
        assert free_pixels(path) == [[False, True, True], [True, True, False]]


class TestPlace:
    def test_the_lower_left_pixel_lies_at_the_origin(self, tmp_path: Path) -> None:
        pixels = np.array([[0, 0, 0], [255, 0, 0]])
        world = read_ros_map(write_map(tmp_path, pixels, origin="[-3.0, 7, 0]"))
        assert world.free.bounds == (-3, 7, -2.5, 7.5)
        assert world.bounds == (-3, 7, -1.5, 8)

    def test_yaw_turns_the_map_about_the_origin(self, tmp_path: Path) -> None:
        """By a quarter turn the lower left pixel comes to lie left of the origin."""
        pixels = np.array([[0, 0, 0], [255, 255, 0]])
        world = read_ros_map(write_map(tmp_path, pixels, origin=f"[10, 20, {np.pi / 2}]"))
        np.testing.assert_allclose(world.free.bounds, (9.5, 20, 10, 21), atol=1e-12)

    def test_numbers_in_exponents_count(self, tmp_path: Path) -> None:
        """YAML 1.1 reads 5e-1 as text."""
        assert read_ros_map(write_map(tmp_path, resolution="5e-1")).bounds == (0, 0, 1.5, 1)

    def test_an_absolute_image_path_is_taken_as_it_is(self, tmp_path: Path) -> None:
        (tmp_path / "elsewhere").mkdir()
        path = write_map(tmp_path, image=str(tmp_path / "map.png"))
        assert read_ros_map(path.rename(tmp_path / "elsewhere" / "map.yaml")).bounds == (0, 0, 1.5, 1)

    def test_maps_of_nav2(self) -> None:
        """The depot is 30.2 m x 15.35 m, its gray (205, p = 0.196) free by its threshold; most of the sandbox is unknown."""
        depot, sandbox = read_ros_map(map_file("depot.yaml")), read_ros_map(map_file("tb3_sandbox.yaml"))
        assert depot.bounds == pytest.approx((0, 0, 30.2, 15.35))
        assert depot.free.area == pytest.approx((170587 + 8894) * 0.05**2)
        assert sandbox.bounds == pytest.approx((-10, -10, 9.2, 9.2))
        assert sandbox.clearance([(-2.0, -0.5), (0.0, 0.0)])[0] > 0.3
        assert read_ros_map(map_file("tb3_sandbox.yaml"), unknown="free").free.area > 10 * sandbox.free.area


class TestErrors:
    @pytest.mark.parametrize("key", HEADER)
    def test_a_missing_key_is_named(self, tmp_path: Path, key: str) -> None:
        with pytest.raises(FileError, match=rf"map\.yaml: expected the key '{key}'"):
            read_ros_map(write_map(tmp_path, **{key: None}))

    @pytest.mark.parametrize(
        ("key", "value", "message"),
        [
            ("resolution", "0", "resolution above 0 .* got 0"),
            ("resolution", "-0.05", "resolution above 0 .* got -0.05"),
            ("resolution", ".nan", "finite number for resolution, got nan"),
            ("resolution", "five", "finite number for resolution, got 'five'"),
            ("resolution", "true", "finite number for resolution, got True"),
            ("origin", "[0, .nan, 0]", "finite number for origin, got nan"),
            ("origin", "[0, 0]", r"origin to be \[x, y, yaw\], got \[0, 0\]"),
            ("origin", "5", "origin to be"),
            ("occupied_thresh", "1.5", "thresholds"),
            ("free_thresh", "0.9", "thresholds .* got 0.9 and 0.65"),
            ("free_thresh", "[]", "free_thresh"),
            ("negate", "2", "negate to be 0 or 1, got 2"),
            ("mode", "fancy", "trinary, scale, raw, got 'fancy'"),
            ("mode", "[1]", "trinary, scale, raw"),
            ("image", "5", "image to be a file name, got 5"),
            ("image", "''", "image to be a file name, got ''"),
            ("image", "nothing.png", "image to name a file, got .*nothing.png, which does not exist"),
            ("image", "map.yaml", r"map\.yaml: expected an image that can be read"),
            ("image", ".", "expected an image that can be read"),
        ],
    )
    def test_a_bad_value_is_named_with_its_key(self, tmp_path: Path, key: str, value: str, message: str) -> None:
        with pytest.raises(FileError, match=message):
            read_ros_map(write_map(tmp_path, **{key: value}))

    @pytest.mark.parametrize(
        ("content", "message"),
        [
            (b"", "got an empty one"),
            (b"\x00\x01\x02", "got a binary one"),
            (b"\xff\xfe\xfd", "got a binary one"),
            (b"just words", "YAML mapping .* got str"),
            (b"- 1\n- 2\n", "YAML mapping .* got list"),
            (b"image: a\nresolution: [1\n", r"map\.yaml:3: expected YAML"),
            (b"image: \x07\n", "expected YAML"),
        ],
    )
    def test_what_is_no_yaml_mapping_is_refused(self, tmp_path: Path, content: bytes, message: str) -> None:
        path = tmp_path / "map.yaml"
        path.write_bytes(content)
        with pytest.raises(FileError, match=message):
            read_ros_map(path)

    def test_a_missing_file_and_a_folder_are_refused(self, tmp_path: Path) -> None:
        with pytest.raises(FileError, match="nothing"):
            read_ros_map(tmp_path / "nothing.yaml")
        with pytest.raises(FileError, match="directory"):
            read_ros_map(tmp_path)

    def test_a_truncated_image_is_refused(self, tmp_path: Path) -> None:
        path = write_map(tmp_path, np.random.default_rng(0).integers(0, 255, (200, 200)))
        image = tmp_path / "map.png"
        image.write_bytes(image.read_bytes()[:5000])
        with pytest.raises(FileError, match=r"map\.png: expected an image that can be read"):
            read_ros_map(path)

    def test_a_map_without_a_free_cell_is_refused(self, tmp_path: Path) -> None:
        with pytest.raises(FileError, match=r"map\.yaml: expected a world with free space"):
            read_ros_map(write_map(tmp_path, np.zeros((2, 3))))

    def test_unknown_cells_are_occupied_or_free(self, tmp_path: Path) -> None:
        with pytest.raises(InvalidInputError, match='"occupied" or "free", got \'maybe\''):
            read_ros_map(write_map(tmp_path), unknown="maybe")
