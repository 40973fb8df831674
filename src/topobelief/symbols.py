"""Names of nodes for a person: an id that is a symbol of GTSAM is shown as that symbol.

GTSAM packs symbols into 64-bit ids. A Symbol has a character in the highest byte and an index in the other 56 bits; a
LabeledSymbol has a character, a label in the next byte and an index in the low 48 bits, and its character may be missing.
Characters and labels are taken for such only where they are ASCII letters: other large ids, such as time stamps, stay numbers.
"""

from __future__ import annotations

import string
from collections.abc import Iterable

_LETTERS = frozenset(string.ascii_letters.encode())


def node_name(node: int) -> str:
    """x3 for GTSAM's symbol of 'x' and 3, aB7 for one with the label 'B', and the number itself for any other id.

    Examples
    --------
    >>> node_name((ord("x") << 56) + 3), node_name((ord("a") << 56) + (ord("B") << 48) + 7), node_name(1700)
    ('x3', 'aB7', '1700')
    """
    letters = [byte for byte in (node >> 56, node >> 48 & 0xFF) if byte]
    if not letters or not _LETTERS.issuperset(letters):
        return str(node)
    return f"{bytes(letters).decode()}{node % (1 << 48)}"


def find_node(nodes: Iterable[int], wanted: int | str) -> int | None:
    """Index of the node with this id or name; None where there is none.

    Examples
    --------
    >>> find_node([7, ord("x") << 56], "x0"), find_node([7, 8], "8"), find_node([7, 8], 9)
    (1, 1, None)
    """
    text = str(wanted)
    return next((index for index, node in enumerate(nodes) if text in (str(node), node_name(node))), None)
