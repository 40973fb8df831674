"""A folder for one run at a time."""

from __future__ import annotations

from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path

from topobelief.errors import FileError


@contextmanager
def alone(folder: Path) -> Generator[None]:
    """Make the folder and keep other runs from it; the operating system lifts the lock however the run ends.

    Raises
    ------
    FileError
        Where another run is at work, or the folder cannot be made.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        file = (folder / ".lock").open("w")
    except OSError as error:
        raise FileError(folder, f"expected a folder to write to, got: {error.strerror}; choose another --out") from None
    with file:
        if not _locked(file.fileno()):
            raise FileError(folder, "expected a folder that no run is using, got one in use by another process; wait for it")
        yield


def _locked(descriptor: int) -> bool:
    """Whether this process has the lock; also where the system knows none."""
    try:
        import fcntl
    except ImportError:  # Windows
        return True
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:  # some network file systems
        return True
    return True
