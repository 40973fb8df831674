"""The documentation builds as a site without a warning, leaves nothing public out, and fetches nothing."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
import typer

from topobelief.cli.app import app

pytest.importorskip("mkdocs")
pytest.importorskip("mkdocstrings_handlers.python")
pytest.importorskip("latex2mathml")
ROOT = Path(__file__).resolve().parents[2]


def test_the_site_builds_strictly_with_every_public_name_and_command(tmp_path):
    """Strictly: a link or an anchor that leads nowhere, or a page that the navigation leaves out, fails the build.

    Not quietly: with `--quiet` MkDocs counts no warnings, and a strict build never fails.
    """
    environment = os.environ | {"PYTHONPATH": str(ROOT / "src"), "NO_MKDOCS_2_WARNING": "1"}
    build = [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", str(tmp_path)]
    done = subprocess.run(build, cwd=ROOT, env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert "WARNING" not in done.stderr
    pages = {page.name: page.read_text(encoding="utf-8") for page in tmp_path.glob("*.html")}

    stub = (ROOT / "src" / "topobelief" / "__init__.pyi").read_text(encoding="utf-8")
    public = re.findall(r"^from \.([\w.]+) import (\w+)", stub, flags=re.MULTILINE)
    entries = {f"topobelief.{module}.{name}" for module, name in public}
    assert entries
    assert {entry for entry in entries if f'id="{entry}"' not in pages["api.html"]} == set()

    commands = typer.main.get_command(app).commands
    assert {name for name in commands if f'id="topobelief-{name}"' not in pages["command_line.html"]} == set()
    options = {option for command in commands.values() for each in command.params for option in each.opts if option[:2] == "--"}
    assert {option for option in options if option not in pages["command_line.html"]} == set()

    for name, page in pages.items():
        assert not re.search(r'<(?:script|img|iframe|link)[^>]*(?:src|href)="?(?:https?:)?//', page), name
        assert "arithmatex" not in page, name
    assert pages["mathematics.html"].count("<math") > 500
