"""Numbers that JSON lacks."""

import math

import numpy as np

from topobelief.io.json_values import without_nan


def test_nan_and_infinity_become_none_at_any_depth():
    given = {"a": [1.5, math.nan, {"b": -math.inf}], "c": np.float64(np.inf), "d": "nan", "e": 3, "f": True}
    assert without_nan(given) == {"a": [1.5, None, {"b": None}], "c": None, "d": "nan", "e": 3, "f": True}
