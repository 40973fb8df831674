"""Array types, and the one way in which values take arrays in: checked once, copied, read-only."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from topobelief.errors import InvalidInputError

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]


def frozen_floats(values: ArrayLike, *, name: str) -> FloatArray:
    """Read-only C-contiguous copy in double precision.

    Raises
    ------
    InvalidInputError
        If the values are not numbers.
    """
    try:
        array = np.array(values, dtype=np.float64, order="C")
    except (TypeError, ValueError) as error:
        raise InvalidInputError(f"expected {name} to be an array of numbers, got {type(values).__name__}: {error}") from None
    array.flags.writeable = False
    return array


def frozen_ints(values: ArrayLike, *, name: str) -> IntArray:
    """Read-only C-contiguous copy as 64-bit integers; fractions are refused, not rounded.

    Raises
    ------
    InvalidInputError
        If the values are not whole numbers.
    """
    raw: NDArray[Any] = np.asarray(values)
    if raw.size == 0:
        raw = raw.astype(np.int64)
    if raw.dtype.kind not in "iu":
        raise InvalidInputError(f"expected {name} to be integers, got dtype {raw.dtype}")
    if raw.dtype == np.uint64 and raw.max() >= 2**63:
        raise InvalidInputError(f"expected {name} below 2^63, got {raw.max()}")
    array = np.array(raw, dtype=np.int64, order="C")
    array.flags.writeable = False
    return array
