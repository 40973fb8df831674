"""Public benchmark graphs fetched over HTTP into the cache folder, their checksums verified.

An interrupted transfer leaves a file that ends in .part, from whose end the next one goes on where the server allows it. The
file takes its name when all of it is there and its SHA-256 is the one that is known.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

from topobelief.errors import FileError
from topobelief.io.datasets import Dataset, dataset_path, find_dataset, folders, named_dataset
from topobelief.optional import load

Transferred = Callable[[int, int], None]
"""Called with the bytes that are there, and with how many there will be."""

_TIMEOUT = 30  # seconds without a byte
_CHUNK = 1 << 16  # bytes


def fetch_dataset(name: str, *, on_progress: Transferred | None = None) -> Path:
    """The file of a public benchmark graph, fetched if it is not on this machine and its address is known.

    Parameters
    ----------
    name
        As `topobelief datasets` lists it.
    on_progress
        Called with the bytes that are there, and with how many there will be, 0 where the server does not say.

    Raises
    ------
    InvalidInputError
        If there is no data set of that name; if its file is not here and has no address, or pooch is not installed.
    FileError
        If it cannot be fetched, or is not the file that it should be; says where to put it.
    """
    dataset = named_dataset(name)
    if (path := find_dataset(dataset)) is not None:
        return path
    if not dataset.address:
        return dataset_path(name)  # which says how to get it
    return _fetched(dataset, folders()[-1], on_progress)


def _fetched(dataset: Dataset, folder: Path, on_progress: Transferred | None) -> Path:
    pooch, requests = load("pooch", "data"), load("requests", "data")
    pooch.get_logger().setLevel(logging.WARNING)
    target = folder / dataset.file
    transfer = _Transfer(folder / f"{dataset.file}.part", on_progress)
    try:
        pooch.retrieve(
            dataset.address, known_hash=f"sha256:{dataset.sha256}", fname=dataset.file, path=folder, downloader=transfer
        )
    except OSError as error:  # those of requests are
        advice = f"try again, or put the file there by hand; it is published at {dataset.home}"
        raise FileError(
            target, f"expected to fetch it from {dataset.address}, got {_reason(requests, error)}; {advice}"
        ) from None
    except ValueError:  # pooch's word for a checksum that differs
        problem = f"expected SHA-256 {dataset.sha256} of {dataset.address}, got another, and discarded the file"
        raise FileError(target, f"{problem}; it was damaged on its way or has changed") from None
    return target


def _reason(requests: Any, error: Any) -> str:
    """What went wrong, in few words: the errors of requests and urllib3 repeat the address at length."""
    if isinstance(error, requests.HTTPError):
        return f"the answer {error.response.status_code} {error.response.reason}"
    if isinstance(error, requests.Timeout):
        return f"no answer for {_TIMEOUT} s"
    if isinstance(error, requests.RequestException):
        return "no connection, or one that broke off"
    return str(error.strerror or type(error).__name__)


class _Transfer:
    """How pooch gets the bytes: appended to a partial file that stays where the transfer breaks off."""

    def __init__(self, part: Path, on_progress: Transferred | None) -> None:
        self._part: Final = part
        self._on_progress: Final = on_progress

    def __call__(self, url: str, output_file: str, pooch: Any, check_only: bool = False) -> None:
        """Bring the file of this address to `output_file`."""
        begun = self._part.stat().st_size if self._part.exists() else 0
        headers = {"Accept-Encoding": "identity"} | ({"Range": f"bytes={begun}-"} if begun else {})
        with load("requests", "data").get(url, headers=headers, stream=True, timeout=_TIMEOUT) as response:
            if response.status_code != 416 or not begun:  # 416: nothing is left to transfer
                response.raise_for_status()
                self._append(response, begun if response.status_code == 206 else 0)
        self._part.replace(output_file)

    def _append(self, response: Any, begun: int) -> None:
        done, length = begun, response.headers.get("Content-Length")
        total = begun + int(length) if length else 0
        with self._part.open("ab" if begun else "wb") as file:
            for chunk in response.iter_content(_CHUNK):
                file.write(chunk)
                done += len(chunk)
                if self._on_progress is not None:
                    self._on_progress(done, total)
