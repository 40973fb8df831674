"""The smallest reproduction that has everything, measured once a process."""

from __future__ import annotations

import shutil
import tempfile
from functools import lru_cache
from pathlib import Path

from topobelief.reproduction.plan import ReproductionPlan
from topobelief.reproduction.run import Reproduction, reproduce
from topobelief.runs.in_process import InProcess

SMALLEST = ReproductionPlan(
    num_seeds=1,
    num_bounds_seeds=1,
    num_timed_seeds=1,
    repetitions=1,
    sizes=(20, 40),
    num_random_graphs=2,
    largest_spectrum=30,
    num_length_paths=4,
    error_maps=("S2",),
    num_error_seeds=1,
    num_real_error_seeds=1,
    num_error_paths=4,
    num_beyond_seeds=1,
    beyond_noises=(0.35,),
    beyond_detours=(1.3,),
    num_beyond_paths=(3, 6),
    num_beyond_evaluations=20,
)


_FOLDER = tempfile.TemporaryDirectory()


@lru_cache(maxsize=1)
def smallest_reproduction() -> Reproduction:
    return reproduce(SMALLEST, Path(_FOLDER.name), InProcess())


def copy_of_smallest_reproduction(folder: Path) -> Reproduction:
    """With all its files in the folder."""
    found = smallest_reproduction()
    shutil.copytree(_FOLDER.name, folder, dirs_exist_ok=True)
    return found
