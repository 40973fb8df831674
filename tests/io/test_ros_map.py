"""ROS maps: what each mode makes of a pixel, where the image lies, and one clear error for everything else."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from data_files import map_file
from topobelief.errors import FileError, InvalidInputError, MapWarning
from topobelief.io.ros_map import read_ros_map, write_ros_map

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


def write_map_header(path: Path, **changes: str) -> Path:
    """Only the YAML file, its header changed."""
    path.write_text("".join(f"{key}: {value}\n" for key, value in (HEADER | changes).items()))
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

    def test_sixteen_bits_of_a_pgm_are_scaled_by_its_largest_value(self, tmp_path: Path) -> None:
        path = write_map(tmp_path, image="map.pgm")
        values = np.array([0, 1000, 900, 400, 1000, 0], dtype=">u2")
        (tmp_path / "map.pgm").write_bytes(b"P5\n3 2\n1000\n" + values.tobytes())
        assert free_pixels(path) == [[False, True, True], [False, True, False]]
        (tmp_path / "map.pgm").write_text("P2\n3 2\n65535\n0 65535 60000\n30000 65535 0\n")
        assert free_pixels(path) == [[False, True, True], [False, True, False]]

    def test_a_grey_declared_transparent_is_unknown(self, tmp_path: Path) -> None:
        path = write_map(tmp_path)
        pixels = np.array([[0, 255, 205], [255, 0, 205]], dtype=np.uint8)
        Image.fromarray(pixels).save(tmp_path / "map.png", transparency=205)
        assert free_pixels(path) == [[False, True, False], [True, False, False]]
        assert free_pixels(path, "free") == [[False, True, True], [True, False, True]]

    def test_one_bit_and_palettes_are_read(self, tmp_path: Path) -> None:
        path = write_map(tmp_path)
        pixels = Image.fromarray(np.array([[0, 255, 255], [255, 255, 0]], dtype=np.uint8))
        for mode in ("1", "P", "LA", "CMYK"):
            image = tmp_path / ("map.tif" if mode == "CMYK" else "map.png")
            pixels.convert("RGB" if mode == "CMYK" else mode).convert(mode).save(image)
            assert free_pixels(write_map_header(path, image=image.name)) == [[False, True, True], [True, True, False]]

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

    def test_names_with_spaces_and_windows_line_ends_are_read(self, tmp_path: Path) -> None:
        path = write_map(tmp_path, image="./my map.png")
        (tmp_path / "map.png").rename(tmp_path / "my map.png")
        path.write_bytes(path.read_bytes().replace(b"\n", b"\r\n"))
        assert read_ros_map(path).bounds == (0, 0, 1.5, 1)

    def test_coordinates_of_a_national_grid_are_kept(self, tmp_path: Path) -> None:
        path = write_map(tmp_path, origin="[500000.0, 5500000.0, 0.0]")
        assert read_ros_map(path).bounds == (500000, 5500000, 500001.5, 5500001)

    def test_maps_of_nav2(self) -> None:
        """The depot is 30.2 m x 15.35 m, its gray (205, p = 0.196) free by its threshold; most of the sandbox is unknown."""
        with pytest.warns(MapWarning, match=r"depot\.yaml: free_thresh 0\.25 makes the grey 205 free"):
            depot = read_ros_map(map_file("depot.yaml"))
        sandbox = read_ros_map(map_file("tb3_sandbox.yaml"))
        assert depot.bounds == pytest.approx((0, 0, 30.2, 15.35))
        assert depot.free.area == pytest.approx((170587 + 8894) * 0.05**2)
        assert sandbox.bounds == pytest.approx((-10, -10, 9.2, 9.2))
        assert sandbox.clearance([(-2.0, -0.5), (0.0, 0.0)])[0] > 0.3
        assert read_ros_map(map_file("tb3_sandbox.yaml"), unknown="free").free.area > 10 * sandbox.free.area


class TestErrors:
    @pytest.mark.parametrize("key", HEADER)
    def test_a_missing_key_is_named(self, tmp_path: Path, key: str) -> None:
        with pytest.raises(FileError, match=rf"map\.yaml:1: expected the key '{key}' of a ROS map, got none"):
            read_ros_map(write_map(tmp_path, **{key: None}))
        with pytest.raises(FileError, match=rf"expected the key '{key}' of a ROS map, got '{key.title()}'"):
            read_ros_map(write_map(tmp_path, **{key: None, key.title(): "1"}))

    @pytest.mark.parametrize(
        ("key", "value", "message"),
        [
            ("resolution", "0", ":2: resolution: expected a number above 0, got '0'"),
            ("resolution", "-0.05", ":2: resolution: expected a number above 0, got '-0.05'"),
            ("resolution", ".nan", ":2: resolution: expected a number above 0, got '.nan'"),
            ("resolution", "five", "resolution: .* got 'five'"),
            ("resolution", "true", "resolution: .* got 'true'"),
            ("resolution", "0,05", "resolution: .* got '0,05'"),
            ("resolution", "[0.05, 0.05]", "resolution: .* got a list of 2"),
            ("resolution", "1e300", r"resolution: expected 1e-06 to 1e\+06 metres a pixel, got '1e300'"),
            ("resolution", "1e-300", "resolution: expected 1e-06 to "),
            ("origin", "[0, .nan, 0]", r":3: origin\[1\]: expected a number, got '.nan'"),
            ("origin", "[0, 0]", r":3: origin: expected \[x, y, yaw\], got a list of 2"),
            ("origin", "5", "origin: expected"),
            ("origin", "{x: 1, y: 2, yaw: 0}", "origin: .* got a mapping"),
            ("origin", "[0, 0, 90]", "yaw in radians, .* got 90; if it is in degrees, write 1.570796"),
            ("origin", "[1e300, 0, 0]", r"origin within 1e\+09 cells of \(0, 0\), got \(1e\+300, 0\)"),
            ("occupied_thresh", "1.5", "occupied_thresh: .* of at most 1, got '1.5'"),
            ("occupied_thresh", "65", "occupied_thresh: .* of at most 1, got '65'"),
            ("free_thresh", "0.9", ":6: free_thresh: .* at most occupied_thresh, which is 0.65, got '0.9'"),
            ("free_thresh", "[]", "free_thresh"),
            ("negate", "2", ":4: negate: expected 0 or 1, got '2'"),
            ("mode", "fancy", "mode: expected one of trinary, scale, raw, got 'fancy'"),
            ("mode", "[1]", "trinary, scale, raw"),
            ("image", "[5]", "image: expected a file name, got a list"),
            ("image", "''", ":1: image: expected a file name, got nothing"),
            ("image", "nothing.png", "image to name a file, got .*nothing.png, which does not exist$"),
            ("image", "/home/bob/map.png", "does not exist; map.png lies beside the map: write image: map.png"),
            ("image", r"C:\maps\map.png", "does not exist; map.png lies beside the map: write image: map.png"),
            ("image", "map.yaml", r"map\.yaml: expected a PGM, PNG or other image, got a file of another kind"),
            ("image", ".", "image to name a file, got .*, which is a directory"),
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
            (b"just words", "YAML mapping .* got 'just words'"),
            (b"- 1\n- 2\n", "YAML mapping .* got a list of 2"),
            (b"image: a\nresolution: [1\n", r"map\.yaml:3: expected YAML"),
            (b"image: \x07\n", "expected YAML"),
            (b"[" * 20000, "expected YAML, got brackets nested too deeply"),
            (b"image: a\n---\nimage: b\n", r"map\.yaml:3: expected one document, got a second one"),
        ],
    )
    def test_what_is_no_yaml_mapping_is_refused(self, tmp_path: Path, content: bytes, message: str) -> None:
        path = tmp_path / "map.yaml"
        path.write_bytes(content)
        with pytest.raises(FileError, match=message):
            read_ros_map(path)

    def test_a_key_given_twice_is_refused(self, tmp_path: Path) -> None:
        path = write_map(tmp_path)
        path.write_text(path.read_text() + "resolution: 0.1\n")
        with pytest.raises(FileError, match=r"map\.yaml:7: resolution: expected each key once, got 'resolution' twice"):
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

    @pytest.mark.parametrize(("kind", "name"), [("int32", "signed or 32-bit integers"), ("float32", "floating-point numbers")])
    def test_pixels_that_no_map_has_are_named(self, tmp_path: Path, kind: str, name: str) -> None:
        path = write_map(tmp_path, image="map.tif")
        Image.fromarray(WHITE.astype(kind)).save(tmp_path / "map.tif")
        with pytest.raises(FileError, match=rf"map\.tif: expected pixels of 8 or 16 bits, got TIFF with {name}; save the map"):
            read_ros_map(path)

    def test_a_pgm_with_converted_line_ends_is_refused(self, tmp_path: Path) -> None:
        """The line feed after the header would count as the first pixel and shift all others."""
        path = write_map(tmp_path, image="map.pgm")
        for largest in (255, 100):
            pixels = bytes([0, largest, largest, largest, largest, 0])
            (tmp_path / "map.pgm").write_bytes(b"P5\r\n3 2\r\n%d\r\n" % largest + pixels)
            with pytest.raises(FileError, match=r"map\.pgm: .* line ends have been converted, which shifts all pixels"):
                read_ros_map(path)
        (tmp_path / "map.pgm").write_bytes(b"P2\r\n3 2\r\n255\r\n0 255 255\r\n255 255 0\r\n")
        assert free_pixels(path) == [[False, True, True], [True, True, False]]

    @pytest.mark.parametrize(
        ("content", "message"),
        [
            (b"", "got an empty file"),
            (b"version https://git-lfs.github.com/spec/v1\noid sha256:0\n", "Git LFS pointer; fetch the image with `git lfs"),
            (b"P5\n0 2\n255\n", "or one without pixels"),
            (b"P5\n3 2\n255\nabc", "expected an image that can be read, got .*truncated"),
        ],
    )
    def test_what_is_no_image_is_named(self, tmp_path: Path, content: bytes, message: str) -> None:
        path = write_map(tmp_path, image="map.pgm")
        (tmp_path / "map.pgm").write_bytes(content)
        with pytest.raises(FileError, match=rf"map\.pgm: .*{message}"):
            read_ros_map(path)

    def test_an_image_that_is_too_large_is_refused_before_it_is_decoded(self, tmp_path: Path) -> None:
        """In our words, whether Pillow would warn of the size, refuse it, or neither."""
        path = write_map(tmp_path, image="map.pgm")
        for side in (12_300, 13_000, 100_000):
            (tmp_path / "map.pgm").write_bytes(b"P5\n%d %d\n255\n" % (side, side))
            with pytest.raises(FileError, match=r"map\.pgm: expected an image of at most 150 million pixels, .*; crop the map"):
                read_ros_map(path)

    def test_an_image_of_many_pixels_in_few_bytes_is_refused_before_it_is_decoded(self, tmp_path: Path) -> None:
        path = write_map(tmp_path, image="map.png")
        Image.new("1", (6000, 6000)).save(tmp_path / "map.png")
        with pytest.raises(FileError, match=r"at most 30 million pixels, or 100 for each byte, got 6000 x 6000 in \d+ bytes"):
            read_ros_map(path)

    def test_no_warning_of_the_image_library_leaks(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        """Pillow warns of images that it finds large: of 90 million pixels, or of what is set here."""
        monkeypatch.setattr(Image, "MAX_IMAGE_PIXELS", 5)
        assert read_ros_map(write_map(tmp_path)).bounds == (0, 0, 1.5, 1)

    def test_a_map_without_a_free_cell_is_refused(self, tmp_path: Path) -> None:
        with pytest.raises(FileError, match=r"map\.yaml: expected a world with free space"):
            read_ros_map(write_map(tmp_path, np.zeros((2, 3))))

    def test_unknown_cells_are_occupied_or_free(self, tmp_path: Path) -> None:
        with pytest.raises(InvalidInputError, match='"occupied" or "free", got \'maybe\''):
            read_ros_map(write_map(tmp_path), unknown="maybe")


class TestDoubts:
    """Maps that are likely to mean something else than they say are read with one line."""

    GREY = np.array([[0, 205, 205], [255, 255, 205]])

    def test_unknown_cells_that_count_as_free(self, tmp_path: Path) -> None:
        path = write_map(tmp_path, self.GREY)
        message = r"map\.yaml: free_thresh 0\.25 makes the grey 205 free.* \(50 % of the map\).* write free_thresh: 0\.196"
        with pytest.warns(MapWarning, match=message):
            assert read_ros_map(path).free.area == 5 * 0.25

    @pytest.mark.parametrize(
        ("changes", "unknown"),
        [({"free_thresh": "0.196"}, "occupied"), ({}, "free"), ({"mode": "scale"}, "occupied"), ({"negate": "1"}, "occupied")],
    )
    def test_no_line_where_that_is_wanted_or_not_so(self, tmp_path: Path, changes: dict[str, str], unknown: str) -> None:
        read_ros_map(write_map(tmp_path, self.GREY, **changes), unknown=unknown)

    def test_a_resolution_that_must_be_in_millimetres(self, tmp_path: Path) -> None:
        with pytest.warns(MapWarning, match="is 50 metres a pixel, .* 150 m wide; if millimetres are meant, write 0.05"):
            read_ros_map(write_map(tmp_path, resolution="50"))


class TestWriting:
    @pytest.mark.parametrize(
        ("name", "origin", "message"),
        [
            ("map.pgm", (0.0, 0.0, 0.0), r"ends in \.yaml or \.yml, got 'map\.pgm'"),
            ("map.yaml", (0.0, float("nan"), 0.0), r"finite origin \(x, y, yaw\), got \(0\.0, nan"),
        ],
    )
    def test_what_could_not_be_read_again_is_not_written(self, tmp_path: Path, name: str, origin: tuple, message: str) -> None:
        with pytest.raises(InvalidInputError, match=message):
            write_ros_map(tmp_path / name, np.zeros((2, 2)), resolution=0.05, origin=origin)
        assert not list(tmp_path.iterdir())

    def test_both_files_are_written_or_none(self, tmp_path: Path) -> None:
        (tmp_path / "map.yaml").mkdir()
        with pytest.raises(FileError, match=r"map\.yaml: expected a file to write, got a directory"):
            write_ros_map(tmp_path / "map.yaml", np.zeros((2, 2)), resolution=0.05)
        assert [path.name for path in tmp_path.iterdir()] == ["map.yaml"]
