"""Options of the families of bounds."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

from topobelief.errors import InvalidInputError, require_choice

Determinant = Literal["cholesky", "hadamard"]


@dataclass(frozen=True, slots=True)
class BoundOptions:
    """Options of the families of bounds; each family takes those that concern it.

    Parameters
    ----------
    determinant
        "cholesky": exact determinant in the lower bound of the entropy. "hadamard": product of its diagonal, cheaper, looser.
    window
        Closures before each one on which the family "chain" conditions it; at least 0.

    Raises
    ------
    InvalidInputError
        For an unknown determinant or a negative window.
    """

    determinant: Determinant = "cholesky"
    window: int = 2

    def __post_init__(self) -> None:
        require_choice("determinant", self.determinant, get_args(Determinant))
        if self.window < 0:
            raise InvalidInputError(f"expected a window of at least 0 closures, got {self.window}")

    @property
    def hadamard(self) -> bool:
        """Whether diagonal blocks take the place of a determinant."""
        return self.determinant == "hadamard"
