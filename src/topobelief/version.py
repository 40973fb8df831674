"""The version of the installed package, from its metadata. Reading those is slow: nothing loads this module unasked."""

from __future__ import annotations

from importlib.metadata import version

__version__ = version("topobelief")
