"""Compiled kernels: numba with a disk cache, without the interpreter's lock, spread over the cores by a thread pool.

Kernels are compiled when they are first called and kept beside the package (or in numba's cache folder where that is not
writable), so only the first call after installing waits. They call no BLAS: its threads would compete with these.
"""

from __future__ import annotations

import itertools
import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any, TypeVar, cast

import numba
import numpy as np

from topobelief.arrays import IntArray

Kernel = TypeVar("Kernel", bound=Callable[..., Any])

_NUMBA: Any = numba  # ships no types


def compiled(kernel: Kernel) -> Kernel:
    """The function compiled for the argument types that it meets; sums may be reordered, which lets them use vectors.

    A tuple argument of b integers makes b known to the compiler: loops over its length are unrolled.
    """
    options = {
        "cache": True,
        "nogil": True,
        "no_cfunc_wrapper": True,
        "error_model": "numpy",
        "fastmath": {"reassoc", "contract"},
    }
    return cast(Kernel, _NUMBA.njit(**options)(kernel))


@compiled
def unset(count: int) -> IntArray:
    """As many indices, all -1. (numba takes seconds to compile `np.full`, `np.arange` and `np.searchsorted`.)"""
    indices = np.empty(count, np.int64)
    for n in range(count):
        indices[n] = -1
    return indices


def num_threads() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def in_parallel(work: Callable[[int, int], Any], bounds: Sequence[int]) -> None:
    """Call `work(start, stop)` for each pair of consecutive bounds, with one thread per core; the first error is raised."""
    parts = [(start, stop) for start, stop in itertools.pairwise(bounds) if stop > start]
    if len(parts) <= 1 or num_threads() == 1:
        for start, stop in parts:
            work(start, stop)
        return
    with ThreadPoolExecutor(min(num_threads(), len(parts))) as pool:
        for result in [pool.submit(work, start, stop) for start, stop in parts]:
            result.result()
