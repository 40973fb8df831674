"""Options of the signatures."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from topobelief.forms.protocol import TreeForms
from topobelief.linalg.estimate import Estimate


@dataclass(frozen=True, slots=True)
class SignatureOptions:
    """Options of signatures; each takes those that concern it.

    Parameters
    ----------
    trees
        The spanning-tree signature that belongs to the objective.
    normalized
        Add the noise normalisation of s_ST to the von Neumann entropy by degrees (the paper's last remark).
    """

    trees: Callable[[TreeForms[Any]], Estimate[Any]]
    normalized: bool = False
