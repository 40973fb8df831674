"""A path of its own: the best that a search of the whole roadmap finds, in place of one of the candidates.

The search counts new poses by distance alone, as its certificate does. If each turn dropped poses too, as front ends do, the
best walk would wind on the spot, for every pose there is predicted to close loops whose errors are independent.
"""

from __future__ import annotations

import warnings
from dataclasses import replace

from topobelief.candidates.propose import predict_along
from topobelief.errors import InvalidInputError, NotOptimizedWarning
from topobelief.optional import has_kernels, missing_packages
from topobelief.strategies.choice import Answer, Reasons
from topobelief.strategies.question import Question

_MOST_EVALUATIONS = 1000


def roadmap(name: str, question: Question) -> Answer:
    """The best way of the roadmap that the candidates are from, within the length that they may have."""
    ground = question.ground
    if ground is None:
        raise InvalidInputError('expected a roadmap for the strategy "roadmap" to search, got candidates alone')
    if not has_kernels():
        raise missing_packages(["numba"], ["fast"])
    from topobelief.search.roadmap_search import search_roadmap

    rule = ground.rule
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", NotOptimizedWarning)  # the planner of the candidates warns
        found = search_roadmap(
            question.graph,
            ground.roadmap,
            goal=ground.goal,
            max_detour=rule.max_detour or 1.0,
            max_length=float(question.lengths.max()) if rule.max_detour is None else None,
            objective=question.objective,
            closures=rule.closures,
            world=ground.world if rule.line_of_sight else None,
            num_alternatives=0,
            spacing=rule.spacing,
            information=rule.information,
            max_evaluations=_MOST_EVALUATIONS,
            refine=True,
            seed=rule.seed,
        )
    (action,) = predict_along(question.graph, ground.world, [found.path], rule)
    way = replace(found.best, action=action)
    return len(question.actions), lambda: Reasons(proposal=way, num_evaluations=found.num_evaluations)
