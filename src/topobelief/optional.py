"""Packages that come with an extra of topobelief: loaded when first used, with one message where they are missing."""

from __future__ import annotations

import importlib
from collections.abc import Sequence
from importlib.util import find_spec
from typing import Any

from topobelief.errors import InvalidInputError

_INSTALLED_AS = {"foxglove": "foxglove-sdk"}  # packages that are installed under another name than they are imported by


def load(package: str, extra: str) -> Any:
    """A module of an optional package.

    Parameters
    ----------
    package
        Name of the module, such as "pyarrow" or "plotly.offline".
    extra
        The extra of topobelief that installs it.

    Raises
    ------
    InvalidInputError
        Where it is not installed; names the package and the extra to install.
    """
    try:
        return importlib.import_module(package)
    except ModuleNotFoundError:
        raise missing_packages([package], [extra]) from None


def is_installed(package: str) -> bool:
    """Whether a package is installed; it is not loaded."""
    return find_spec(package) is not None


def has_kernels() -> bool:
    """Whether numba is installed, which compiles the kernels of increments."""
    return is_installed("numba")


def missing_packages(packages: Sequence[str], extras: Sequence[str]) -> InvalidInputError:
    """The error to raise where packages of some extras are not installed."""
    names = [name.partition(".")[0] for name in packages]
    shown = " and ".join(_INSTALLED_AS.get(name, name) for name in names)
    return InvalidInputError(f"expected {shown} to be installed, got none; run pip install 'topobelief[{','.join(extras)}]'")
