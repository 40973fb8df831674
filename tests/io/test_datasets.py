"""Data sets by name: each is what the list says, and one that is absent says where it goes."""

from __future__ import annotations

import hashlib
from pathlib import Path

import pytest

from data_files import data_file
from topobelief.errors import InvalidInputError
from topobelief.io.datasets import DATASETS, dataset_path
from topobelief.io.formats import read_graph_file
from topobelief.io.reading import ReadingOptions

OPTIONS = {"w100": {"drop": "equiv"}, "w10000": {"drop": "equiv"}, "w20000": {"edge2_order": "isam_root"}}


@pytest.mark.parametrize("name", DATASETS)
def test_a_data_set_is_what_the_list_says(name: str):
    dataset = DATASETS[name]
    path = dataset_path(name) if dataset.in_gtsam else data_file(dataset.file)
    graph = read_graph_file(path, ReadingOptions(**OPTIONS.get(name, {}))).graph
    assert (graph.num_poses, graph.num_edges) == (dataset.num_poses, dataset.num_edges)
    assert graph.group.name == f"SE({dataset.space[0]})"
    for value in OPTIONS.get(name, {}).values():
        assert value in dataset.note


def test_a_file_that_can_be_fetched_is_the_one_that_was_counted():
    for dataset in DATASETS.values():
        assert dataset.home.startswith("https://")
        assert bool(dataset.address) == bool(dataset.sha256)
        if dataset.address:
            assert hashlib.sha256(data_file(dataset.file).read_bytes()).hexdigest() == dataset.sha256


def test_the_given_folder_goes_first_then_the_cache_then_gtsam(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setattr("sys.platform", "linux")
    monkeypatch.delenv("TOPOBELIEF_DATA", raising=False)
    assert dataset_path("w100").parent.name == "Data"
    cached = tmp_path / "cache" / "topobelief" / "datasets" / "w100.graph"
    cached.parent.mkdir(parents=True)
    cached.touch()
    assert dataset_path("w100") == cached
    monkeypatch.setenv("TOPOBELIEF_DATA", str(tmp_path))
    (tmp_path / "w100.graph").touch()
    assert dataset_path("w100") == tmp_path / "w100.graph"


def test_an_absent_file_says_where_it_goes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setattr("sys.platform", "linux")
    monkeypatch.setenv("TOPOBELIEF_DATA", str(tmp_path / "data"))
    with pytest.raises(
        InvalidInputError, match=r"expected intel.g2o in .*data or .*datasets, got none; put the file there; it is published at"
    ):
        dataset_path("intel")
    with pytest.raises(InvalidInputError, match=r"put the file there, or fetch it with `topobelief datasets csail`"):
        dataset_path("csail")
    monkeypatch.setattr("topobelief.io.datasets.find_spec", lambda _: None)
    with pytest.raises(InvalidInputError, match=r"put the file there, or install GTSAM, which brings it: pip install"):
        dataset_path("w100")


def test_an_unknown_name_is_refused_with_the_known_ones():
    with pytest.raises(InvalidInputError, match=r"expected a data set among intel, csail, .*, got 'torus'"):
        dataset_path("torus")
