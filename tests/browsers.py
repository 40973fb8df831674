"""A real browser for tests of pages, where the machine has one."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest

_CHROMIUM = os.environ.get("TOPOBELIEF_CHROMIUM") or shutil.which("chromium") or shutil.which("chromium-browser")
_FLAGS = [
    *("--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run"),
    *("--disable-background-networking", "--disable-component-update", "--disable-sync"),
]
browser_test = pytest.mark.skipif(
    _CHROMIUM is None, reason="no chromium: install the system's package, or name the program in TOPOBELIEF_CHROMIUM"
)


@contextmanager
def chromium() -> Iterator[Any]:
    """A browser; the test is skipped where nothing can drive it."""
    playwright = pytest.importorskip("playwright.sync_api")
    with playwright.sync_playwright() as started:
        browser = started.chromium.launch(executable_path=_CHROMIUM, args=_FLAGS)
        yield browser
        browser.close()
