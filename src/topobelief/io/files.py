"""Text files are read as a whole, and files are written completely or not at all.

Reading turns everything that can be wrong with a path into one `FileError`. Writing goes to a temporary file beside the
target, which takes the target's name only when it is complete: an interrupted program leaves the old file or none.
"""

from __future__ import annotations

import os
import stat
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path
from uuid import uuid4

from topobelief.errors import FileError

StrPath = str | os.PathLike[str]

EXPANSION = 100
"""Bytes, or pixels, that each byte of a compressed file may stand for: a few kilobytes can be made to stand for gigabytes."""


def read_text(path: StrPath, *, any_encoding: bool = False) -> str:
    """The content of a text file.

    Parameters
    ----------
    path
        A file in UTF-8, of which ASCII is a part. A byte order mark is dropped and line ends become "\\n".
    any_encoding
        Whether bytes that are not UTF-8 become "\ufffd", as in a format that is ASCII but for its comments.

    Raises
    ------
    FileError
        If the file is missing, a directory, not readable, empty, or not text.
    """
    content = read_bytes(path)
    if not content.strip():
        raise FileError(path, "expected a text file, got an empty one")
    if b"\0" in content:
        raise FileError(path, f"expected a text file, got a binary one (NUL at byte {content.index(0)})")
    try:
        text = content.decode("utf-8-sig", errors="replace" if any_encoding else "strict")
    except UnicodeDecodeError as error:
        raise FileError(path, f"expected a text file, got a binary one (not UTF-8 at byte {error.start})") from None
    return text.replace("\r\n", "\n").replace("\r", "\n")


def read_bytes(path: StrPath) -> bytes:
    """The content of a file.

    Raises
    ------
    FileError
        If the file is missing, a directory or not readable.
    """
    try:
        return Path(path).read_bytes()
    except OSError as error:
        raise FileError(path, _reason(error, "a file to read")) from None


def read_head(path: StrPath, size: int = 65536) -> bytes:
    """The first bytes of a file, which show what it is.

    Raises
    ------
    FileError
        If the file is missing, a directory or not readable.
    """
    try:
        with Path(path).open("rb") as file:
            return file.read(size)
    except OSError as error:
        raise FileError(path, _reason(error, "a file to read")) from None


@contextmanager
def atomic_file(path: StrPath) -> Generator[Path]:
    """A temporary path beside `path` to write to; it becomes `path` when the block ends, and vanishes if it fails.

    The temporary name keeps the suffix, by which many writers choose a format. A file that is replaced keeps its
    permissions, a new one gets those of any new file; a symbolic link keeps pointing where it did.

    Raises
    ------
    FileError
        If there is no such folder, permission is missing, or `path` is a directory or a device.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     with atomic_file(Path(folder, "numbers.txt")) as temporary:
    ...         _ = temporary.write_text("1 2 3")
    ...     sorted(file.name for file in Path(folder).iterdir())
    ['numbers.txt']
    """
    target = Path(os.path.realpath(path))
    temporary = target.with_name(f".{target.stem}.{uuid4().hex[:12]}{target.suffix}")
    try:
        _require_replaceable(target)
        temporary.touch(exist_ok=False)
        if target.exists():
            temporary.chmod(stat.S_IMODE(target.stat().st_mode))
    except OSError as error:
        raise FileError(path, _reason(error, "a file to write")) from None
    try:
        yield temporary
        temporary.replace(target)
    except OSError as error:
        raise FileError(path, _reason(error, "a file to write")) from None
    finally:
        temporary.unlink(missing_ok=True)


def write_text(path: StrPath, text: str) -> None:
    """Write a whole text file, or nothing.

    Raises
    ------
    FileError
        If the file cannot be written.
    """
    with atomic_file(path) as temporary:
        temporary.write_text(text, encoding="utf-8", newline="\n")


def _require_replaceable(target: Path) -> None:
    """Raise what writing in place would raise, and refuse devices and pipes, which a rename would destroy."""
    if target.is_dir():
        raise IsADirectoryError
    if target.exists() and not target.is_file():
        raise FileExistsError
    if target.exists() and not os.access(target, os.W_OK):
        raise PermissionError


def _reason(error: OSError, expected: str) -> str:
    """What was expected and what the system found instead."""
    match error:
        case FileNotFoundError():
            found = "nothing of that name" if expected.endswith("read") else "a folder that does not exist"
        case IsADirectoryError():
            found = "a directory"
        case NotADirectoryError():
            found = "a path through something that is not a directory"
        case FileExistsError():
            found = "a device or pipe"
        case PermissionError():
            found = "one without permission"
        case _:
            found = f"a system error: {error.strerror or error}"
    return f"expected {expected}, got {found}"
