"""`datasets` lists public graphs and finds their files."""

from __future__ import annotations

import json

from topobelief.io.datasets import DATASETS, dataset_path


def test_the_list_names_each_with_its_file(topobelief, tmp_path, monkeypatch):
    monkeypatch.setenv("TOPOBELIEF_DATA", str(tmp_path))
    (tmp_path / "intel.g2o").touch()
    outcome = topobelief(["datasets"])
    assert outcome.code == 0
    assert all(name in outcome.out for name in DATASETS)
    assert f"Others may be put into {tmp_path} or " in outcome.out
    document = json.loads(topobelief(["datasets", "--json"]).out)
    assert [entry["name"] for entry in document["datasets"]] == list(DATASETS)
    assert document["datasets"][0]["path"] == str(tmp_path / "intel.g2o")
    assert document["datasets"][1]["path"] is None


def test_one_name_gives_its_path_for_another_command(topobelief):
    assert topobelief(["datasets", "w100"]).out == f"{dataset_path('w100')}\n"
    assert json.loads(topobelief(["datasets", "w100", "--json"]).out)["path"] == str(dataset_path("w100"))


def test_an_unknown_name_is_one_line(topobelief):
    outcome = topobelief(["datasets", "torus"])
    assert (outcome.code, outcome.err.count("\n")) == (2, 1)
    assert "expected a data set among intel, csail" in outcome.err
