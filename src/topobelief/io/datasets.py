"""Public benchmark graphs by name: what each is, and where its file is on this machine.

Files are looked for in the folder $TOPOBELIEF_DATA, in the cache folder of topobelief, and, for those that the Python package
of GTSAM brings along, in that package. Nothing is fetched.
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
    """

    name: str
    file: str
    num_poses: int
    num_edges: int
    space: str
    source: str
    note: str = ""
    in_gtsam: bool = False


_DEAD = "its poses are dead reckoning: optimise first"
DATASETS = {
    dataset.name: dataset
    for dataset in (
        Dataset("intel", "intel.g2o", 1228, 1483, "2D", "real, Intel lab in Seattle", "one edge has information 2.7e12"),
        Dataset("csail", "csail.g2o", 1045, 1172, "2D", "real, MIT CSAIL building", f"one edge comes twice; {_DEAD}"),
        Dataset(
            "manhattan3500", "manhattan3500.g2o", 3500, 5598, "2D", "simulated, streets of a grid", f"145 pairs twice; {_DEAD}"
        ),
        Dataset("city10000", "city10000.g2o", 10000, 20687, "2D", "simulated, streets of a grid", _DEAD),
        Dataset("ais2klinik", "ais2klinik.g2o", 15115, 16727, "2D", "real, outdoors in Freiburg", "very anisotropic noise"),
        Dataset("kitti_05", "kitti_05.g2o", 2761, 2826, "2D", "real, a car, sequence 05 of KITTI", "no vertex lines"),
        Dataset("parking-garage", "parking-garage.g2o", 1661, 6275, "3D", "real, a car park on several floors", _DEAD),
        Dataset("sphere2500", "sphere2500.g2o", 2500, 4949, "3D", "simulated, on a sphere", _DEAD),
        Dataset("smallGrid3D", "smallGrid3D.g2o", 125, 297, "3D", "simulated, a grid in space", _DEAD),
        Dataset("w100", "w100.graph", 100, 300, "2D", "simulated by TORO", "read with --drop equiv", in_gtsam=True),
        Dataset(
            "w10000", "w10000.graph", 10000, 64311, "2D", "simulated, TORO's world", "read with --drop equiv", in_gtsam=True
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
        ),
        Dataset("grid27", "pose3example-grid.txt", 27, 44, "3D", "simulated, a small grid in space", in_gtsam=True),
        Dataset("toy3D", "toyExample.g2o", 5, 6, "3D", "made by hand", in_gtsam=True),
    )
}


def dataset_path(name: str) -> Path:
    """The file of a public benchmark graph on this machine.

    Parameters
    ----------
    name
        As `topobelief datasets` lists it.

    Raises
    ------
    InvalidInputError
        If there is no data set of that name, or its file is in none of the folders; says where to put it.
    """
    if name not in DATASETS:
        raise InvalidInputError(f"expected a data set among {', '.join(DATASETS)}, got {name!r}")
    path = find_dataset(DATASETS[name])
    if path is None:
        message = f"expected {DATASETS[name].file} in {' or '.join(map(str, folders()))}, got none; put the file there"
        advice = ", or install GTSAM, which brings it: pip install 'topobelief[gtsam]'" if DATASETS[name].in_gtsam else ""
        raise InvalidInputError(message + advice)
    return path


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
