"""JSON has neither nan nor infinity; null stands for both."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import Any, cast


def without_nan(value: Any) -> Any:
    """A value for JSON, with None for each float that is nan or infinite, in dictionaries and lists too."""
    if isinstance(value, float):
        return float(value) if math.isfinite(value) else None
    if isinstance(value, dict):
        return {name: without_nan(each) for name, each in cast("dict[Any, Any]", value).items()}
    if isinstance(value, list):
        return [without_nan(each) for each in cast("list[Any]", value)]
    return value


def json_in_script(document: Mapping[str, Any]) -> str:
    """JSON that may stand in a script element."""
    text = json.dumps(without_nan(document), allow_nan=False, separators=(",", ":"))
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")
