"""Text files in, whole files out."""

from __future__ import annotations

import os
import stat
from pathlib import Path

import pytest

from topobelief.errors import FileError
from topobelief.io.files import atomic_file, read_text, write_text


def test_reading_normalises_line_ends_and_drops_a_byte_order_mark(tmp_path: Path):
    path = tmp_path / "text"
    path.write_bytes(b"\xef\xbb\xbfone\r\ntwo\rthree\n\xc3\xa4")
    assert read_text(path) == "one\ntwo\nthree\nä"


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "expected a text file, got an empty one"),
        (b" \n\t\n", "expected a text file, got an empty one"),
        (b"VERTEX\0", r"expected a text file, got a binary one \(NUL at byte 6\)"),
        (b"\x1f\x8b\x08", r"expected a text file, got a binary one \(not UTF-8 at byte 1\)"),
    ],
)
def test_content_that_is_no_text_is_refused(content: bytes, message: str, tmp_path: Path):
    path = tmp_path / "graph.g2o"
    path.write_bytes(content)
    with pytest.raises(FileError, match=message) as caught:
        read_text(path)
    assert str(caught.value).startswith(f"{path}: ")
    assert caught.value.line is None


def test_bytes_of_other_encodings_may_be_let_through(tmp_path: Path):
    path = tmp_path / "graph.g2o"
    path.write_bytes("# Größe\nFIX 0\n".encode("latin-1"))
    assert read_text(path, any_encoding=True) == "# Gr\ufffd\ufffde\nFIX 0\n"
    path.write_bytes(b"\xe4\0")
    with pytest.raises(FileError, match="got a binary one"):
        read_text(path, any_encoding=True)


def test_a_path_that_is_no_file_is_refused(tmp_path: Path):
    """Nothing, a directory, and a path through a file each say what is there instead."""
    (tmp_path / "file").write_text("text")
    with pytest.raises(FileError, match="expected a file to read, got nothing of that name"):
        read_text(tmp_path / "absent")
    with pytest.raises(FileError, match="expected a file to read, got a directory"):
        read_text(tmp_path)
    with pytest.raises(FileError, match="got a path through something that is not a directory"):
        read_text(tmp_path / "file" / "below")
    with pytest.raises(FileError, match="expected a file to read, got a system error: File name too long"):
        read_text(tmp_path / ("x" * 300))


def test_a_new_file_is_as_open_as_any_other(tmp_path: Path):
    """Permissions of a new file are those of a file made without a detour."""
    (tmp_path / "plain").touch()
    write_text(tmp_path / "written", "text\n")
    assert (tmp_path / "written").read_text() == "text\n"
    assert (tmp_path / "written").stat().st_mode == (tmp_path / "plain").stat().st_mode


def test_a_replaced_file_keeps_its_permissions(tmp_path: Path):
    path = tmp_path / "private"
    path.write_text("old")
    path.chmod(0o600)
    write_text(path, "new")
    assert (path.read_text(), stat.S_IMODE(path.stat().st_mode)) == ("new", 0o600)


def test_a_link_keeps_pointing_to_what_is_replaced(tmp_path: Path):
    (tmp_path / "target").write_text("old")
    (tmp_path / "link").symlink_to(tmp_path / "target")
    write_text(tmp_path / "link", "new")
    assert (tmp_path / "link").is_symlink()
    assert (tmp_path / "target").read_text() == "new"


def test_a_failure_while_writing_leaves_the_old_file_alone(tmp_path: Path):
    """Whatever is raised half-way, an interrupt too, the old file stays and the temporary one goes."""
    path = tmp_path / "file.txt"
    path.write_text("old")

    def interrupted() -> None:
        with atomic_file(path) as temporary:
            temporary.write_text("half of the n")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


def test_the_temporary_file_is_a_neighbour_with_the_same_suffix(tmp_path: Path):
    """A rename is atomic within a folder only, and some writers choose a format by the suffix."""
    with atomic_file(tmp_path / "picture.png") as temporary:
        assert temporary.parent == tmp_path
        assert temporary.suffix == ".png"
        assert not (tmp_path / "picture.png").exists()


def test_a_place_that_cannot_be_written_is_refused(tmp_path: Path):
    (tmp_path / "file").write_text("text")
    os.mkfifo(tmp_path / "pipe")
    for path, message in (
        (tmp_path, "expected a file to write, got a directory"),
        (tmp_path / "absent" / "file", "expected a file to write, got a folder that does not exist"),
        (tmp_path / "file" / "below", "got a path through something that is not a directory"),
        (tmp_path / "pipe", "expected a file to write, got a device or pipe"),
    ):
        with pytest.raises(FileError, match=message):
            write_text(path, "text")


@pytest.mark.skipif(os.geteuid() == 0, reason="the superuser may write everywhere")
def test_missing_permission_is_named(tmp_path: Path):
    path = tmp_path / "file"
    path.write_text("old")
    path.chmod(0o400)
    with pytest.raises(FileError, match="expected a file to write, got one without permission"):
        write_text(path, "new")
    path.chmod(0o000)
    with pytest.raises(FileError, match="expected a file to read, got one without permission"):
        read_text(path)
