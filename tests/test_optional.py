"""Optional packages: one loader, one message."""

from __future__ import annotations

import sys

import pytest

from topobelief.errors import InvalidInputError
from topobelief.optional import load


def test_an_installed_module_is_loaded():
    assert load("json.decoder", "fast").JSONDecoder


@pytest.mark.parametrize(
    ("module", "extra", "name"),
    [("pyarrow", "study", "pyarrow"), ("plotly.offline", "page", "plotly"), ("foxglove.channels", "view", "foxglove-sdk")],
)
def test_a_missing_package_is_named_with_the_extra_that_brings_it(monkeypatch, module, extra, name):
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(InvalidInputError) as error:
        load(module, extra)
    assert str(error.value) == f"expected {name} to be installed, got none; run pip install 'topobelief[{extra}]'"
