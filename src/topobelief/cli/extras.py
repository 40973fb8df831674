"""What a command needs beyond the package itself, said before anything that needs it is loaded."""

from __future__ import annotations

from importlib.util import find_spec

from topobelief.optional import missing_packages

_PACKAGES = {
    "fast": ("numba",),
    "gtsam": ("gtsam",),
    "sim": ("gtsam", "mujoco", "small_gicp"),
    "page": ("plotly",),
    "view": ("foxglove",),
}


def require_extras(*extras: str) -> None:
    """Check that what some extras bring is installed.

    Raises
    ------
    InvalidInputError
        Names the packages that are missing and what to install.
    """
    absent = [package for extra in extras for package in _PACKAGES[extra] if find_spec(package) is None]
    if absent:
        raise missing_packages(absent, extras)
