"""Data sets are fetched whole, go on where they broke off, and are kept only if their checksum is right."""

from __future__ import annotations

import hashlib
import threading
from collections.abc import Generator
from dataclasses import replace
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import pytest

from topobelief.errors import FileError, InvalidInputError
from topobelief.io.datasets import DATASETS
from topobelief.io.fetching import fetch_dataset

CONTENT = "".join(f"VERTEX_SE2 {k} {k} 0 0\n" for k in range(20000)).encode()


class Server(ThreadingHTTPServer):
    """Serves CONTENT, whole or from a byte on; breaks off or fails when told to."""

    def __init__(self) -> None:
        super().__init__(("127.0.0.1", 0), Handler)
        self.asked: list[str | None] = []  # ranges
        self.ranges, self.ends_at, self.status = True, len(CONTENT), 200


class Handler(BaseHTTPRequestHandler):
    server: Server

    def do_GET(self) -> None:
        asked = self.headers.get("Range")
        self.server.asked.append(asked)
        begin = int(asked[6:-1]) if asked and self.server.ranges else 0
        status = 416 if begin >= len(CONTENT) else 206 if begin else self.server.status
        self.send_response(status)
        self.send_header("Content-Length", "0" if status >= 400 else str(len(CONTENT) - begin))
        self.end_headers()
        if status < 400:
            self.wfile.write(CONTENT[begin : self.server.ends_at])

    def log_message(self, format: str, *args: object) -> None:
        pass


@pytest.fixture
def server(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Generator[Server]:
    """A server, and a data set "small" whose file it has; the cache is in a temporary folder."""
    monkeypatch.delenv("TOPOBELIEF_DATA", raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setattr("sys.platform", "linux")
    with Server() as running:
        address = f"http://127.0.0.1:{running.server_port}/small.g2o"
        checksum = hashlib.sha256(CONTENT).hexdigest()
        small = replace(DATASETS["intel"], name="small", file="small.g2o", address=address, sha256=checksum)
        monkeypatch.setitem(DATASETS, "small", small)
        thread = threading.Thread(target=running.serve_forever, kwargs={"poll_interval": 0.01})
        thread.start()
        yield running
        running.shutdown()
        thread.join()


def cached(tmp_path: Path) -> Path:
    return tmp_path / "topobelief" / "datasets" / "small.g2o"


def test_a_file_is_fetched_once_with_its_progress(server: Server, tmp_path: Path):
    told: list[tuple[int, int]] = []
    path = fetch_dataset("small", on_progress=lambda done, total: told.append((done, total)))
    assert path == cached(tmp_path)
    assert path.read_bytes() == CONTENT
    assert told[-1] == (len(CONTENT), len(CONTENT))
    assert len(told) > 1
    assert fetch_dataset("small") == path
    assert server.asked == [None]
    assert [file.name for file in path.parent.iterdir()] == ["small.g2o"]


def test_a_transfer_that_broke_off_goes_on_from_there(server: Server, tmp_path: Path):
    server.ends_at = 100_000
    with pytest.raises(
        FileError,
        match=r"expected to fetch it from http.*, got no connection, or one that broke off; try again, or put the",
    ):
        fetch_dataset("small")
    assert not cached(tmp_path).exists()
    begun = cached(tmp_path).with_name("small.g2o.part").stat().st_size
    assert 0 < begun <= 100_000
    server.ends_at = len(CONTENT)
    assert fetch_dataset("small").read_bytes() == CONTENT
    assert server.asked == [None, f"bytes={begun}-"]


def test_a_server_without_ranges_begins_again(server: Server, tmp_path: Path):
    part = cached(tmp_path).with_name("small.g2o.part")
    part.parent.mkdir(parents=True)
    part.write_bytes(CONTENT[:5000])
    server.ranges = False
    assert fetch_dataset("small").read_bytes() == CONTENT


def test_a_part_that_is_all_of_it_is_taken(server: Server, tmp_path: Path):
    part = cached(tmp_path).with_name("small.g2o.part")
    part.parent.mkdir(parents=True)
    part.write_bytes(CONTENT)
    assert fetch_dataset("small").read_bytes() == CONTENT


def test_another_file_is_discarded(server: Server, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setitem(DATASETS, "small", replace(DATASETS["small"], sha256="0" * 64))
    with pytest.raises(FileError, match=r"small.g2o: expected SHA-256 0+ of http.*, got another, and discarded the file"):
        fetch_dataset("small")
    assert list(cached(tmp_path).parent.iterdir()) == []


def test_a_refusal_says_where_the_file_may_be_put(server: Server):
    server.status = 404
    with pytest.raises(
        FileError,
        match=r"datasets/small.g2o: expected to fetch .*got the answer 404 Not Found; .*; it is published at https://luca",
    ):
        fetch_dataset("small")


def test_what_has_no_address_says_how_to_get_it(server: Server):
    with pytest.raises(InvalidInputError, match=r"expected intel.g2o in .*, got none; put the file there; it is published at"):
        fetch_dataset("intel")


def test_without_pooch_the_extra_is_named(server: Server, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setitem(__import__("sys").modules, "pooch", None)
    with pytest.raises(
        InvalidInputError, match=r"expected pooch to be installed, got none; run pip install 'topobelief\[data\]'"
    ):
        fetch_dataset("small")
