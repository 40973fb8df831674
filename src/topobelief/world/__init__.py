"""Worlds: where a robot may be, how far from it the nearest obstacle is, and what it can see; in the plane and in space."""

from __future__ import annotations

from topobelief.world.space import FreeSpace
from topobelief.world.world import Extent, World
from topobelief.world.world_3d import World3D

__all__ = ["Extent", "FreeSpace", "World", "World3D"]
