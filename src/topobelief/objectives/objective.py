"""What the planner asks of an objective."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import ClassVar

from topobelief.bounds.options import BoundOptions
from topobelief.forms.protocol import Forms, TreeForms
from topobelief.linalg.estimate import Estimate, Number

Family = Callable[[Forms[Number], BoundOptions], tuple[Estimate[Number], Estimate[Number]]]
"""(lower, upper) bounds of ln det I."""


class Objective(ABC):
    """A number that an action makes large or small; the smaller, the better.

    Entropies are decreasing functions of ln det I with the rest exact, so bounds of ln det I bound them.
    """

    quantity: ClassVar[str]
    """What it is, in a sentence and a table."""
    description: ClassVar[str]
    """What it is, where there is room."""
    unit: ClassVar[str] = "nats"
    """Of the objective, its bounds and costs; `topobelief.planning.units` says how numbers of a unit are shown."""

    @abstractmethod
    def of(self, log_det: Estimate[Number], forms: Forms[Number]) -> Estimate[Number]:
        """The objective where ln det I is `log_det`.

        Raises
        ------
        IllConditionedError
            If double precision cannot give it to 0.1 nats; where there are K values, those that it cannot give are nan.
        """

    @abstractmethod
    def trees(self, forms: TreeForms[Number]) -> Estimate[Number]:
        """The spanning-tree signature that belongs to the objective; the larger, the better."""

    def exact(self, forms: Forms[Number]) -> Estimate[Number]:
        """The objective itself."""
        return self.of(forms.log_det("joint"), forms)

    def bounds(
        self, family: Family[Number], options: BoundOptions, forms: Forms[Number]
    ) -> tuple[Estimate[Number], Estimate[Number]]:
        """(lower, upper) bounds of the objective."""
        low, high = family(forms, options)
        return self.of(high, forms), self.of(low, forms)
