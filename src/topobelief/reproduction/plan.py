"""What a reproduction measures: seeds, sizes, files."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from topobelief.errors import InvalidInputError
from topobelief.reproduction.beyond_candidates import DETOURS, NUM_PATHS
from topobelief.reproduction.entropy_or_error import MAPS
from topobelief.reproduction.planning_sessions import NOISES


@dataclass(frozen=True, slots=True, kw_only=True)
class ReproductionPlan:
    """What to measure.

    Attributes
    ----------
    seed
        The first one; all others follow from it.
    num_seeds
        Of roadmap and paths, behind the table of claims.
    num_bounds_seeds
        Of them, for what bounds are worth.
    num_timed_seeds, repetitions
        Of the times per action.
    sizes, degree_increases, num_random_graphs
        Random graphs: poses, increases of the average degree, and graphs for each pair.
    largest_spectrum
        Poses above which the exact von Neumann entropy is left out, and real graphs in "entropy or error".
    num_length_paths
        Candidates in the figure of path lengths.
    error_maps, num_error_seeds, num_real_error_seeds, num_error_paths
        Entropy or error: the maps, seeds on each and on each real pose graph, and candidates.
    num_beyond_seeds, beyond_noises, beyond_detours, num_beyond_paths, num_beyond_evaluations
        The search of the whole roadmap beside candidates: seeds, noises and detours of the decisions, diverse paths made each
        time, and evaluations of a search.
    files, num_real_actions
        Real pose graphs, and candidates on each.
    quick
        Whether the numbers were chosen for a first look.
    """

    seed: int = 0
    num_seeds: int = 30
    num_bounds_seeds: int = 30
    num_timed_seeds: int = 3
    repetitions: int = 7
    sizes: tuple[int, ...] = (100, 300, 1000, 3000, 10_000)
    degree_increases: tuple[float, ...] = (0.1, 0.5, 0.75, 1.0, 2.0)
    num_random_graphs: int = 10
    largest_spectrum: int = 2000
    num_length_paths: int = 60
    error_maps: tuple[str, ...] = MAPS
    num_error_seeds: int = 30
    num_real_error_seeds: int = 3
    num_error_paths: int = 20
    num_beyond_seeds: int = 3
    beyond_noises: tuple[float, ...] = NOISES
    beyond_detours: tuple[float, ...] = DETOURS
    num_beyond_paths: tuple[int, ...] = NUM_PATHS
    num_beyond_evaluations: int = 1000
    files: tuple[Path, ...] = ()
    num_real_actions: int = 50
    quick: bool = False

    @staticmethod
    def for_a_first_look(*, seed: int = 0, files: tuple[Path, ...] = ()) -> ReproductionPlan:
        """Few seeds and small graphs: under two minutes."""
        return ReproductionPlan(
            seed=seed,
            num_seeds=5,
            num_bounds_seeds=2,
            num_timed_seeds=1,
            repetitions=3,
            sizes=(100, 200, 400, 800, 1600),
            num_random_graphs=3,
            largest_spectrum=800,
            num_length_paths=40,
            num_error_seeds=2,
            num_real_error_seeds=1,
            num_error_paths=10,
            num_beyond_seeds=1,
            beyond_noises=NOISES[1:2],
            beyond_detours=DETOURS[:1],
            files=files,
            num_real_actions=20,
            quick=True,
        )

    def __post_init__(self) -> None:
        for name, value, least in (
            ("seed", self.seed, 0),
            ("num_seeds", self.num_seeds, 1),
            ("num_bounds_seeds", self.num_bounds_seeds, 1),
            ("num_timed_seeds", self.num_timed_seeds, 1),
            ("repetitions", self.repetitions, 1),
            ("num_random_graphs", self.num_random_graphs, 2),
            ("num_length_paths", self.num_length_paths, 2),
            ("num_error_seeds", self.num_error_seeds, 1),
            ("num_real_error_seeds", self.num_real_error_seeds, 1),
            ("num_error_paths", self.num_error_paths, 2),
            ("num_beyond_seeds", self.num_beyond_seeds, 1),
            ("num_beyond_evaluations", self.num_beyond_evaluations, 1),
            *(("num_beyond_paths", number, 1) for number in self.num_beyond_paths),
            ("num_real_actions", self.num_real_actions, 2),
            *(("sizes", size, 10) for size in self.sizes),
        ):
            if value < least:
                raise InvalidInputError(f"expected {name} of at least {least}, got {value}")
        stems = [path.stem for path in self.files]
        if len(set(stems)) < len(stems):
            raise InvalidInputError(f"expected pose graphs of different names, got {', '.join(sorted(stems))}")

    def to_dict(self) -> dict[str, Any]:
        """Plain values for JSON; files by their names."""
        return {**asdict(self), "files": [path.name for path in self.files]}
