"""The picture of docs/page.md: `topobelief serve` on the office of the demo, seen in Chromium."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

from playwright.sync_api import sync_playwright

HERE = Path(__file__).parent
OFFICE = HERE.parents[1] / "examples" / "office"


def main() -> None:
    command = [
        sys.executable,
        "-m",
        "topobelief",
        "serve",
        "recorded.g2o",
        "--map",
        "recorded.yaml",
        "--port",
        "0",
        "--seconds",
        "10",
    ]
    with subprocess.Popen(command, cwd=OFFICE, stdout=subprocess.PIPE, text=True) as server:
        assert server.stdout is not None
        address = next(line.split()[1] for line in server.stdout if line.startswith("Open "))
        with sync_playwright() as started:
            browser = started.chromium.launch(executable_path=shutil.which("chromium"), args=["--no-sandbox"])
            photograph(browser.new_page(viewport={"width": 1280, "height": 860}), address)
            browser.close()
        server.terminate()


def photograph(page: Any, address: str) -> None:
    page.goto(address)
    for field, value in (("goal-x", "25"), ("goal-y", "-2.95"), ("limit", "28")):
        page.fill(f"#{field}", value)
    page.click("#ask")
    page.wait_for_selector("#ways:not([hidden])", timeout=120_000)
    page.wait_for_selector("#stop", state="hidden", timeout=120_000)
    page.screenshot(path=HERE / "page.png")


if __name__ == "__main__":
    main()
