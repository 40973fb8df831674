"""Array types, and the one way in which values take arrays in: checked once, copied, read-only, also when copied again."""

from __future__ import annotations

from dataclasses import fields
from typing import Any, TypeVar, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from topobelief.errors import InvalidInputError

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]

_Array = TypeVar("_Array", bound=NDArray[Any])


class ReadOnlyArrays:
    """Base of the dataclasses whose arrays are read-only: pickles and deep copies of them are so too.

    NumPy forgets the flag when it copies or unpickles an array. Fields alone are taken over, not what was computed from them.
    """

    __slots__ = ()

    def __reduce__(self) -> tuple[Any, ...]:
        values = {field.name: getattr(self, field.name) for field in fields(self)}  # pyright: ignore[reportArgumentType]
        return _with_read_only_arrays, (type(self), values)


def _with_read_only_arrays(kind: type[Any], values: dict[str, Any]) -> Any:
    instance: Any = object.__new__(kind)
    for name, value in values.items():
        is_array = isinstance(value, np.ndarray)
        object.__setattr__(instance, name, read_only(cast("NDArray[Any]", value)) if is_array else value)
    return instance


def read_only(array: _Array) -> _Array:
    """The same array, which can no longer be written to."""
    array.flags.writeable = False
    return array


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
    return read_only(array)


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
    return read_only(array)
