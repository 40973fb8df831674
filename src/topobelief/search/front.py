"""The front of length against value: the best walk at each length."""

from __future__ import annotations

import numpy as np

from topobelief.arrays import FloatArray, IntArray


def on_front(lengths: FloatArray, values: FloatArray) -> IntArray:
    """Which of some walks no walk that is at most as long is as good as.

    Parameters
    ----------
    lengths, values : shape (N,)

    Returns
    -------
    shape (F,)
        Indices by increasing length, and so by decreasing value.

    Examples
    --------
    >>> import numpy as np
    >>> on_front(np.array([3.0, 1.0, 2.0, 2.5]), np.array([4.0, 9.0, 5.0, 7.0])).tolist()
    [1, 2, 0]
    """
    order = np.lexsort((values, lengths))
    best = np.minimum.accumulate(np.concatenate([[np.inf], values[order]]))
    return order[values[order] < best[:-1]]


def spread_on_front(lengths: FloatArray, count: int) -> IntArray:
    """Some points of a front, spread over its lengths: for so many limits at equal distances, the last point within each.

    Parameters
    ----------
    lengths : shape (F,)
        Increasing.
    count
        At least 2.

    Returns
    -------
    shape (at most count,)
        Indices, increasing; the first and the last are among them.

    Examples
    --------
    >>> import numpy as np
    >>> spread_on_front(np.array([1.0, 1.1, 1.2, 3.0, 5.0]), 3).tolist()
    [0, 3, 4]
    """
    if len(lengths) <= count:
        return np.arange(len(lengths))
    limits: FloatArray = np.linspace(float(lengths[0]), float(lengths[-1]), count)
    return np.unique(np.searchsorted(lengths, limits, side="right") - 1)
