"""Planar worlds: where a robot may be, how far from it the nearest obstacle is, and what it can see."""

from __future__ import annotations

from topobelief.world.world import Extent, World

__all__ = ["Extent", "World"]
