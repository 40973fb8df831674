"""What the planner asks of an objective."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import ClassVar, Literal

from topobelief.bounds.options import BoundOptions
from topobelief.forms.protocol import Forms, TreeForms
from topobelief.linalg.estimate import Estimate, Number

Family = Callable[[Forms[Number], BoundOptions], tuple[Estimate[Number], Estimate[Number]]]
"""(lower, upper) bounds of what the objective is a function of."""

Unit = Literal["nats", "m"]
Argument = Literal["log_det", "squared_error"]


class Objective(ABC):
    """A number that an action makes large or small; the smaller, the better.

    It is a monotone function of one argument, the rest exact, so bounds of the argument bound it.

    Attributes
    ----------
    unit
    argument
        What it is a function of; families of bounds are those of the argument.
    cheap_bounds, tight_bounds
        Families between which "auto" chooses.
    """

    unit: ClassVar[Unit]
    argument: ClassVar[Argument]
    cheap_bounds: ClassVar[str]
    tight_bounds: ClassVar[str]

    @abstractmethod
    def exact(self, forms: Forms[Number]) -> Estimate[Number]:
        """The objective itself.

        Raises
        ------
        IllConditionedError
            If double precision cannot give it; where there are K values, those that it cannot give are nan.
        """

    @abstractmethod
    def bounds(
        self, family: Family[Number], options: BoundOptions, forms: Forms[Number]
    ) -> tuple[Estimate[Number], Estimate[Number]]:
        """(lower, upper) bounds of the objective from a family of bounds of its argument."""

    @abstractmethod
    def known(self, forms: Forms[Number]) -> bool:
        """Whether `exact` costs nothing more, since bounds took the same increments."""

    @abstractmethod
    def trees(self, forms: TreeForms[Number]) -> Estimate[Number]:
        """The spanning-tree signature that belongs to the objective; the larger, the better."""


class Entropy(Objective):
    """A decreasing function of ln det I."""

    unit = "nats"
    argument = "log_det"
    cheap_bounds = "fischer"
    tight_bounds = "chain"

    @abstractmethod
    def of(self, log_det: Estimate[Number], forms: Forms[Number]) -> Estimate[Number]:
        """The entropy where ln det I is `log_det`.

        Raises
        ------
        IllConditionedError
            If double precision cannot give it to 0.1 nats; where there are K values, those that it cannot give are nan.
        """

    def exact(self, forms: Forms[Number]) -> Estimate[Number]:
        return self.of(forms.log_det("joint"), forms)

    def bounds(
        self, family: Family[Number], options: BoundOptions, forms: Forms[Number]
    ) -> tuple[Estimate[Number], Estimate[Number]]:
        low, high = family(forms, options)
        return self.of(high, forms), self.of(low, forms)

    def known(self, forms: Forms[Number]) -> bool:
        return forms.knows("joint")
