"""What a command needs beyond the package itself, said before anything that needs it is loaded."""

from __future__ import annotations

from topobelief.optional import is_installed, missing_packages

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
    absent = [package for extra in extras for package in _PACKAGES[extra] if not is_installed(package)]
    if absent:
        raise missing_packages(absent, extras)
