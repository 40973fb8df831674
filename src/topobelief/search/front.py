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


def below_front(bounds: FloatArray, lengths: FloatArray, values: FloatArray) -> FloatArray:
    """Bounds that are not above the front, from its shortest walk on.

    A walk that closes loops with itself may be better than the bound says, which does not count them.

    Parameters
    ----------
    bounds : shape (G, 2)
        By increasing length.
    lengths, values : shape (F,)
        Of the front.

    Returns
    -------
    shape (at most G, 2)

    Examples
    --------
    >>> import numpy as np
    >>> bounds = np.array([[0.5, 9.0], [1.5, 7.0], [3.0, 5.0]])
    >>> below_front(bounds, np.array([1.0, 2.0]), np.array([6.0, 4.0])).tolist()
    [[1.5, 6.0], [3.0, 4.0]]
    """
    kept = bounds[bounds[:, 0] >= lengths[0]]
    best = values[np.searchsorted(lengths, kept[:, 0], side="right") - 1]
    return np.column_stack([kept[:, 0], np.minimum(kept[:, 1], best)])


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
