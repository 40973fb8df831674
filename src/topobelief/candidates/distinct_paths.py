"""Paths that are further than a distance from each other, by the discrete Fréchet distance of places along them.

A new path is compared with few of those that are there. How near a path comes to a landmark differs between two paths by
no more than their Fréchet distance, so the paths that are near a new one are among those that come about as near to each
of some landmarks.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial.distance import cdist

from topobelief.arrays import FloatArray
from topobelief.candidates.polyline import sampled

_NUM_SAMPLES = 32  # places at which the distance of two paths is taken; at most 62, see frechet_within


class DistinctPaths:
    """A growing set of paths, and whether another one is near to one of them.

    Parameters
    ----------
    landmarks : shape (L, dim)
        Anywhere among the paths.
    """

    def __init__(self, landmarks: FloatArray) -> None:
        self._landmarks = landmarks
        self._samples: FloatArray = np.zeros((16, _NUM_SAMPLES, landmarks.shape[1]))
        self._approaches: FloatArray = np.zeros((len(landmarks), 16))  # distance from each landmark to each path
        self._count = 0

    def __len__(self) -> int:
        return self._count

    def add(self, path: FloatArray) -> None:
        """Add a path, shape (waypoints, dim)."""
        if self._count == len(self._samples):
            self._samples = np.concatenate([self._samples, np.zeros_like(self._samples)])
            self._approaches = np.concatenate([self._approaches, np.zeros_like(self._approaches)], axis=1)
        sample = sampled(path, _NUM_SAMPLES)
        self._samples[self._count] = sample
        self._approaches[:, self._count] = self._approach(sample)
        self._count += 1

    def any_within(self, path: FloatArray, distance: float) -> bool:
        """Whether one of the paths is at most a distance from this one."""
        sample = sampled(path, _NUM_SAMPLES)
        apart = np.abs(self._approaches[:, : self._count] - self._approach(sample)[:, None]).max(axis=0, initial=0.0)
        near: list[int] = np.flatnonzero(apart <= distance).tolist()
        return any(frechet_within(sample, self._samples[path], distance) for path in near)

    def _approach(self, sample: FloatArray) -> FloatArray:
        return cdist(self._landmarks, sample).min(axis=1)


def frechet_within(waypoints: FloatArray, others: FloatArray, distance: float) -> bool:
    """Whether the discrete Fréchet distance of two sequences of places is at most a distance.

    Eiter and Mannila, "Computing discrete Fréchet distance", 1994: two walkers go through the places of a sequence each, one
    or both a place further at a time; is there a way to do it with never more than the distance between them? The
    places where the second can be when the first is at one of his are the bits of a number.

    Parameters
    ----------
    waypoints, others : shape (N, dim), shape (M, dim)
        M at most 62.
    distance
    """
    bits = 2 << np.arange(len(others), dtype=np.int64)
    rows: list[int] = ((cdist(waypoints, others) <= distance) @ bits).tolist()  # by place of the first: those near it
    reached = 1  # ahead of the first place
    for row in rows:
        entered = row & (reached | (reached << 1))
        # On along runs of ones: the carry of the sum clears them from an entered bit on, except for further entered bits.
        reached = entered | (row & ~(row + entered))
    return bool(reached & int(bits[-1]))
