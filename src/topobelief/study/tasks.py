"""One task for each combination that a study asks for, complete in itself: it can be sent anywhere.

A task's id is a digest of everything that its result depends on, and the seed of its own random numbers. So neither the
order of tasks nor who plays them matters, and a study that grows keeps the rows that it has.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from hashlib import blake2b

import numpy as np

from topobelief.graph.noise import Noise
from topobelief.graph.pose_graph import PoseGraph
from topobelief.study.specification import Rule, Session, Specification
from topobelief.world import World

_RESULTS = 1  # raise it where the same task comes to have another result


@dataclass(frozen=True, eq=False, slots=True)
class Task:
    """A session in a world, at one noise, by one strategy, for one objective, with one seed.

    Attributes
    ----------
    id : str
        32 hexadecimal digits.
    place : str
        The same for all tasks of one world, session and rule, digits too.
    world_name, world, session, noise, strategy, objective, seed, rule
    """

    id: str
    place: str
    world_name: str
    world: World
    session: Session
    noise: Noise
    strategy: str
    objective: str
    seed: int
    rule: Rule

    @property
    def rng(self) -> np.random.Generator:
        """Random numbers of this task alone, the same whoever asks."""
        return np.random.default_rng(int(self.id, 16))

    @property
    def labels(self) -> dict[str, str | int | float]:
        """The columns that say which combination it is."""
        return {
            "world": self.world_name,
            "session": self.session.name,
            "sigma_p": self.noise.sigma_p,
            "sigma_theta": self.noise.sigma_theta,
            "xi": self.noise.xi,
            "strategy": self.strategy,
            "objective": self.objective,
            "seed": self.seed,
        }


def tasks_of(specification: Specification) -> list[Task]:
    """All tasks; those of one seed come together, so that every stretch of a run is like the rest."""
    return [task for seed in specification.seeds for task in _of_seed(specification, seed)]


def _of_seed(specification: Specification, seed: int) -> Iterator[Task]:
    rule = specification.rule
    for session, names in specification.sessions:
        for name in names:
            world = specification.worlds[name]
            place = _digest(world.digest, _session_content(session), rule.content)
            for noise in specification.noises:
                for objective in specification.objectives:
                    for strategy in specification.strategies:
                        identity = _digest(_RESULTS, place, name, session.name, asdict(noise), strategy, objective, seed)
                        yield Task(identity, place, name, world, session, noise, strategy, objective, seed, rule)


def _digest(*content: object) -> str:
    text = json.dumps(content, sort_keys=True)
    return blake2b(text.encode(), digest_size=16).hexdigest()


def _session_content(session: Session) -> list[object]:
    return [_graph_digest(session.graph), session.goals, session.num_paths]


def _graph_digest(graph: PoseGraph) -> str:
    """Of what was measured and where the graph begins: the estimate follows from these, but for its last bits."""
    arrays = (graph.poses[:1], graph.edges.astype(np.float64), graph.measurements, graph.information)
    content = b"".join(np.array(array.shape).tobytes() + array.tobytes() for array in arrays)
    return blake2b(content, digest_size=16).hexdigest()
