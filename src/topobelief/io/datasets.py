"""Public benchmark graphs by name: what each is, where its file is on this machine, and where it comes from.

Files are looked for in the folder $TOPOBELIEF_DATA, in the cache folder of topobelief, and, for those that the Python package
of GTSAM brings along, in that package. Those with an address can be fetched into the cache folder.
"""

from __future__ import annotations

import os
import sys
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path

from topobelief.errors import InvalidInputError


@dataclass(frozen=True, slots=True)
class Dataset:
    """A public pose graph.

    Parameters
    ----------
    name
        How it is asked for.
    file
        Name of its file.
    num_poses, num_edges
        As `topobelief.read_pose_graph` reads it.
    space
        "2D" or "3D".
    source
        Where it was recorded or simulated.
    note
        What to know before using it, options of reading among that.
    in_gtsam
        Whether the Python package of GTSAM has the file.
    home
        Where it is published.
    address, sha256
        Of the file itself, where it can be fetched: an address whose content does not change, and its checksum.
    """

    name: str
    file: str
    num_poses: int
    num_edges: int
    space: str
    source: str
    note: str = ""
    in_gtsam: bool = False
    home: str = ""
    address: str = ""
    sha256: str = ""


_GTSAM = "https://github.com/borglab/gtsam"
_CARLONE = "https://lucacarlone.mit.edu/datasets/"
_DPGO = "https://github.com/mit-acl/dpgo"
_RISAM = "https://github.com/rpl-cmu/risam"
_RISAM_FILES = "https://raw.githubusercontent.com/rpl-cmu/risam/788613e83ca86d450a9bc26a76366e28912dccea/experiments/datasets"
_DEAD = "its poses are dead reckoning: optimise first"
DATASETS = {
    dataset.name: dataset
    for dataset in (
        Dataset(
            "intel",
            "intel.g2o",
            1228,
            1483,
            "2D",
            "real, Intel lab in Seattle",
            "one edge has information 2.7e12",
            home=_CARLONE,
        ),
        Dataset(
            "csail",
            "csail.g2o",
            1045,
            1172,
            "2D",
            "real, MIT CSAIL building",
            f"one edge comes twice; {_DEAD}",
            home=_CARLONE,
            address=f"{_RISAM_FILES}/csail/csail.g2o",
            sha256="4eb61c008048b39a7a8f7b0a3e67cca0ce86ae5aaeda9332630a230c91a19056",
        ),
        Dataset(
            "manhattan3500",
            "manhattan3500.g2o",
            3500,
            5598,
            "2D",
            "simulated, streets of a grid",
            f"145 pairs twice; {_DEAD}",
            home=_RISAM,
        ),
        Dataset("city10000", "city10000.g2o", 10000, 20687, "2D", "simulated, streets of a grid", _DEAD, home=_RISAM),
        Dataset(
            "ais2klinik",
            "ais2klinik.g2o",
            15115,
            16727,
            "2D",
            "real, outdoors in Freiburg",
            "very anisotropic noise",
            home=_DPGO,
        ),
        Dataset(
            "kitti_05", "kitti_05.g2o", 2761, 2826, "2D", "real, a car, sequence 05 of KITTI", "no vertex lines", home=_DPGO
        ),
        Dataset(
            "parking-garage", "parking-garage.g2o", 1661, 6275, "3D", "real, a car park on several floors", _DEAD, home=_CARLONE
        ),
        Dataset("sphere2500", "sphere2500.g2o", 2500, 4949, "3D", "simulated, on a sphere", _DEAD, home=_RISAM),
        Dataset("smallGrid3D", "smallGrid3D.g2o", 125, 297, "3D", "simulated, a grid in space", _DEAD, home=_DPGO),
        Dataset(
            "w100", "w100.graph", 100, 300, "2D", "simulated by TORO", "read with --drop equiv", in_gtsam=True, home=_GTSAM
        ),
        Dataset(
            "w10000",
            "w10000.graph",
            10000,
            64311,
            "2D",
            "simulated, TORO's world",
            "read with --drop equiv",
            in_gtsam=True,
            home=_GTSAM,
        ),
        Dataset(
            "w20000",
            "w20000.txt",
            20061,
            26831,
            "2D",
            "simulated, from iSAM",
            "read with --edge2-order isam_root; no vertex lines",
            in_gtsam=True,
            home=_GTSAM,
        ),
        Dataset(
            "grid27", "pose3example-grid.txt", 27, 44, "3D", "simulated, a small grid in space", in_gtsam=True, home=_GTSAM
        ),
        Dataset("toy3D", "toyExample.g2o", 5, 6, "3D", "made by hand", in_gtsam=True, home=_GTSAM),
    )
}


def dataset_path(name: str) -> Path:
    """The file of a public benchmark graph on this machine; nothing is fetched.

    Parameters
    ----------
    name
        As `topobelief datasets` lists it.

    Raises
    ------
    InvalidInputError
        If there is no data set of that name, or its file is in none of the folders; says where to put it and how to get it.
    """
    dataset = named_dataset(name)
    path = find_dataset(dataset)
    if path is None:
        expected = f"expected {dataset.file} in {' or '.join(map(str, folders()))}, got none; put the file there"
        raise InvalidInputError(f"{expected}{_how_to_get(dataset)}")
    return path


def named_dataset(name: str) -> Dataset:
    """The data set of this name.

    Raises
    ------
    InvalidInputError
        If there is none.
    """
    if name not in DATASETS:
        raise InvalidInputError(f"expected a data set among {', '.join(DATASETS)}, got {name!r}")
    return DATASETS[name]


def _how_to_get(dataset: Dataset) -> str:
    if dataset.in_gtsam:
        return ", or install GTSAM, which brings it: pip install 'topobelief[gtsam]'"
    if dataset.address:
        return f", or fetch it with `topobelief datasets {dataset.name}` (in Python fetch_dataset({dataset.name!r}))"
    return f"; it is published at {dataset.home}"


def find_dataset(dataset: Dataset) -> Path | None:
    """Its file, if one of the folders has it."""
    places = [folder / dataset.file for folder in folders()]
    if dataset.in_gtsam and (spec := find_spec("gtsam")) is not None:
        places += [Path(folder, "Data", dataset.file) for folder in spec.submodule_search_locations or ()]
    return next((place for place in places if place.is_file()), None)


def folders() -> list[Path]:
    """Where files are looked for and may be put: $TOPOBELIEF_DATA if it is set, and the cache folder."""
    given = os.environ.get("TOPOBELIEF_DATA")
    return [*([Path(given)] if given else []), _cache() / "topobelief" / "datasets"]


def _cache() -> Path:
    """The folder for caches of this system."""
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA") or Path.home() / "AppData" / "Local")
    if sys.platform == "darwin":
        return Path.home() / "Library" / "Caches"
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
