"""What can go wrong, one root: every error that topobelief raises on purpose is a `TopobeliefError`.

A message says what was expected and what was found, names the place (file and line, edge, node, action),
and then what to do. The values that it names are attributes too, so that a program need not parse text.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from os import PathLike, fspath

from topobelief.symbols import node_name


class TopobeliefError(Exception):
    """Root of all errors raised on purpose; its message is one line."""


class ReadingWarning(UserWarning):
    """A graph is not quite what its file says, because an option of reading dropped or assumed something; says what."""


class InvalidInputError(TopobeliefError, ValueError):
    """An argument does not have the shape, range or kind that the function documents."""


class FileError(TopobeliefError):
    """A file cannot be read or written, or its content does not follow the format.

    Attributes
    ----------
    path : str
    line : int or None
        1-based line number, where one line is to blame.
    """

    def __init__(self, path: str | PathLike[str], message: str, *, line: int | None = None) -> None:
        self.path = fspath(path)
        self.line = line
        place = self.path if line is None else f"{self.path}:{line}"
        super().__init__(f"{place}: {message}")


class InvalidGraphError(InvalidInputError):
    """A pose graph or topology is malformed: shapes, indices, self-loops, information matrices."""


class DisconnectedGraphError(InvalidGraphError):
    """Some nodes are not reached from the anchor, so the entropy is infinite and no spanning tree exists.

    Attributes
    ----------
    nodes : tuple of int
        Unreached nodes, by the names the file gave them where it gave any.
    """

    def __init__(self, nodes: Sequence[int], *, anchor: int, what: str = "graph") -> None:
        self.nodes = tuple(int(node) for node in nodes)
        shown = ", ".join(map(node_name, self.nodes[:5]))
        more = f" and {len(self.nodes) - 5} more" if len(self.nodes) > 5 else ""
        super().__init__(
            f"expected a connected {what}, got {len(self.nodes)} node(s) that node {node_name(anchor)} does not reach: "
            f"{shown}{more}; add the missing edges or keep one component"
        )


class InvalidActionError(InvalidInputError):
    """A candidate action is malformed.

    Attributes
    ----------
    action : int or None
        Index of the action in the list that was given.
    edge : int or None
        Index of the edge in the action.
    """

    def __init__(self, message: str, *, action: int | None = None, edge: int | None = None, label: str = "") -> None:
        self.action = action
        self.edge = edge
        place = "action" if action is None else f"action {action}"
        if label:
            place += f" ({label!r})"
        if edge is not None:
            place += f", edge {edge}"
        super().__init__(f"{place}: {message}")


class IllConditionedError(TopobeliefError, ArithmeticError):
    """Double precision cannot give the quantity with a meaningful error.

    Attributes
    ----------
    what : str
        What was asked for.
    error_estimate : float
        Estimated absolute error of what was asked for (inf where the factorisation broke down).
    unit : str
        Its unit: "nats", or "m" for an expected error of the map.
    """

    def __init__(self, what: str, error_estimate: float, *, unit: str = "nats") -> None:
        self.what, self.unit = what, unit
        self.error_estimate = math.inf if math.isnan(error_estimate) else error_estimate
        known = math.isfinite(self.error_estimate)
        loss = f"estimated error {error_estimate:.1e} {unit}" if known else "rounding leaves no digit"
        super().__init__(
            f"{what}: the graph is too ill-conditioned for double precision ({loss}); "
            "check the units and the information matrices for extreme ratios"
        )


class EstimationError(TopobeliefError):
    """The maximum-likelihood estimate could not be found."""


class InvalidMapError(InvalidInputError):
    """A floor plan is malformed."""


class MapWarning(UserWarning):
    """A floor plan can be read, but is likely to mean something else than it says."""


class PlanningError(TopobeliefError):
    """No path can be planned: the start or the goal is outside the map, in collision, or unreachable."""


def degrees_hint(angle: float) -> str:
    """What to add to an error about an angle that is too large: it may be in degrees."""
    if not math.isfinite(angle):
        return ""
    return f"; angles are in radians, and {angle:g} degrees are {math.radians(angle):.4g} radians"


class NotOptimizedWarning(UserWarning):
    """Entropies or bounds are asked for at poses that are far from the maximum-likelihood estimate."""


def require_choice(name: str, value: str, choices: Collection[str]) -> None:
    """Raise `InvalidInputError` naming the choices where `value` is not one of them."""
    if value not in choices:
        listed = ", ".join(f'"{choice}"' for choice in choices)
        raise InvalidInputError(f"expected {name} to be one of {listed}, got {value!r}")
