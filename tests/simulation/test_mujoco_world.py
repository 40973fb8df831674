"""The model: any world's walls stand where its free region ends."""

from __future__ import annotations

import importlib

import numpy as np
import pytest

import topobelief as tb
from topobelief.errors import InvalidInputError
from topobelief.simulation.mujoco_world import build_model, load_mujoco
from topobelief.simulation.robot_settings import RobotSettings

mujoco = pytest.importorskip("mujoco")

WORLDS = {
    "boxes": tb.World.from_boxes([(4, 1, 5, 2)], bounds=(0, 0, 10, 8)),
    "triangle": tb.World.from_polygons([[(3, 3), (6, 4), (4, 6)]], bounds=(0, 0, 10, 8)),
    "thin wall": tb.World.from_boxes([(4, 1, 4.05, 7)], bounds=(0, 0, 10, 8)),
    "turned cells": tb.World.from_cells(np.pad(np.eye(6, dtype=np.bool_), 3, constant_values=True), 0.7, (5.0, -2.0, 0.4)),
}


@pytest.mark.parametrize("name", WORLDS)
def test_the_chassis_touches_where_its_clearance_ends(name: str) -> None:
    world, settings = WORLDS[name], RobotSettings()
    model = build_model(world, settings)
    data = mujoco.MjData(model)
    chassis = model.geom("chassis").id
    x_min, y_min, x_max, y_max = world.bounds
    places = np.random.default_rng(0).uniform((x_min, y_min), (x_max, y_max), size=(400, 2))
    clearance = world.clearance(places)
    sure = (clearance > 0) & (np.abs(clearance - settings.radius) > 0.002)
    assert sure.sum() > 100
    assert (clearance[sure] < settings.radius).any()
    for place, room in zip(places[sure], clearance[sure], strict=True):
        data.qpos[:3] = *place, settings.wheel_radius
        mujoco.mj_forward(model, data)
        assert (data.contact.geom == chassis).any() == (room < settings.radius)


def test_without_a_world_the_floor_is_all_there_is() -> None:
    model = build_model(None, RobotSettings())
    assert model.ngeom == 1 + 3 + 2  # floor; chassis, ballast, caster; tyres


def test_missing_mujoco_is_named_with_the_extra_that_brings_it(monkeypatch: pytest.MonkeyPatch) -> None:
    def missing(name: str) -> object:
        raise ModuleNotFoundError(name)

    monkeypatch.setattr(importlib, "import_module", missing)
    with pytest.raises(InvalidInputError, match=r"pip install 'topobelief\[sim\]'"):
        load_mujoco()
