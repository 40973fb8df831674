"""A command without its extras says what to install, before it loads or writes anything."""

import subprocess
import sys

import pytest

from topobelief.cli import extras
from topobelief.errors import InvalidInputError

HIDE = """
import importlib.abc, importlib.util, sys

class Hidden(importlib.abc.MetaPathFinder):
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in {hidden}:
            raise ModuleNotFoundError(name)

find = importlib.util.find_spec
importlib.util.find_spec = lambda name, *a: None if name in {hidden} else find(name, *a)
sys.meta_path.insert(0, Hidden())
from topobelief.cli.app import run
sys.exit(run({arguments}))
"""


@pytest.mark.parametrize(
    ("arguments", "hidden", "message"),
    [
        (
            ["benchmark", "--quick"],
            {"numba"},
            "expected numba to be installed, got none; run pip install 'topobelief[fast,gtsam]'",
        ),
        (["reproduce", "--quick"], {"numba", "plotly"}, "expected numba and plotly to be installed"),
        (["simulate", "office"], {"mujoco", "gtsam"}, "run pip install 'topobelief[sim]'"),
        (["simulate-compare", "office"], {"small_gicp"}, "expected small_gicp to be installed"),
    ],
)
def test_missing_packages_are_named_in_one_line(arguments, hidden, message, tmp_path):
    program = HIDE.format(hidden=hidden, arguments=arguments)
    found = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, cwd=tmp_path, check=False)
    assert found.returncode == 2, found.stderr
    assert message in found.stderr
    assert found.stderr.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


def test_nothing_is_said_where_all_is_there(monkeypatch):
    extras.require_extras("fast", "gtsam", "sim", "page")
    monkeypatch.setattr(extras, "is_installed", lambda package: False)
    with pytest.raises(
        InvalidInputError, match=r"expected numba to be installed, got none; run pip install 'topobelief\[fast\]'"
    ):
        extras.require_extras("fast")
