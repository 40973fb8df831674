"""Robust edges read as plain ones: switchable constraints and max-mixtures, after Vertigo (Sünderhauf).

    EDGE_SE2_SWITCHABLE i j switch x y theta I11 I12 I13 I22 I23 I33
    EDGE_SE2_MAXMIX i j weight x y theta I11 I12 I13 I22 I23 I33

and likewise EDGE_SE3_. Vertigo reads the weight before the measurement and writes none; other programs put it behind.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence

from topobelief.errors import FileError
from topobelief.io.dialect import Tag
from topobelief.io.files import StrPath

ROBUST_EDGE = re.compile(r"(EDGE_SE(2|3|3:QUAT))_(SWITCHABLE|MAXMIX)")
SWITCHES = ("VERTEX_SWITCH", "EDGE_SWITCH_PRIOR")  # dropped where switchable edges are plain


def plain_edges(path: StrPath, lines: Sequence[list[str]], tags: Mapping[str, Tag]) -> tuple[dict[int, list[str]], list[str]]:
    """Robust edges rewritten as plain ones.

    Parameters
    ----------
    path
        The file, for errors.
    lines
        Fields of all lines; the tag comes first.
    tags
        The plain edges that are known.

    Returns
    -------
    rewritten : dict
        By index of a line, the fields of the plain edge in it.
    notes : list of str
        What was assumed, if there is any such edge.

    Raises
    ------
    FileError
        If the weight of max-mixtures is neither before nor behind their measurement.
    """
    rewritten: dict[int, list[str]] = {}
    weighted: dict[int, Tag] = {}
    counts: Counter[str] = Counter()
    for index, fields in enumerate(lines):
        match = ROBUST_EDGE.fullmatch(fields[0]) if fields else None
        if match is None:
            continue
        plain_tag = match[1] if match[1] in tags else f"{match[1]}:QUAT"
        if plain_tag not in tags:
            continue
        counts[fields[0]] += 1
        if match[3] == "SWITCHABLE":
            rewritten[index] = [plain_tag, *fields[1:3], *fields[4:]]
            continue
        rewritten[index] = [plain_tag, *fields[1:]]
        if len(fields) == tags[plain_tag].num_fields + 2:  # with its tag and one number more
            weighted[index] = tags[plain_tag]
    for before in (True, False):
        places = {index: 3 if before else 3 + tag.group.pose_size for index, tag in weighted.items()}
        if all(_is_weight(rewritten[index][place]) for index, place in places.items()):
            for index, place in places.items():
                del rewritten[index][place]
            break
    else:
        index = min(weighted)
        message = f"expected the weight of {lines[index][0]} from 0 to 1 before or behind the measurement, got neither"
        raise FileError(path, message, line=index + 1)
    listed = ", ".join(f"{count} {tag}" for tag, count in counts.items())
    assumed = (
        f"took robust edges ({listed}) for plain ones: each counts as a correct measurement with the information it states"
    )
    return rewritten, [f"{assumed}; dropped their switches and weights"] if counts else []


def _is_weight(text: str) -> bool:
    try:
        return 0 <= float(text) <= 1
    except ValueError:
        return False
