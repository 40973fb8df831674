"""Names of nodes for a person: an id that is a symbol of GTSAM is shown as that symbol.

GTSAM packs symbols into 64-bit ids. A Symbol has a character in the highest byte and an index in the other 56 bits; a
LabeledSymbol has a character, a label in the next byte and an index in the low 48 bits, and its character may be missing.
Characters are taken for such only where they are letters of Latin-1, and labels where they are of ASCII: other large ids, such
as time stamps, stay numbers. Ids have a sign: keys from 2^63 on are the negative ids that have the same 64 bits.
"""

from __future__ import annotations

import string
from collections.abc import Iterable

_LABELS = frozenset(string.ascii_letters.encode())
_CHARACTERS = _LABELS | {byte for byte in range(0xC0, 0xFF) if chr(byte).isalpha()}


def node_name(node: int) -> str:
    """x3 for GTSAM's symbol of 'x' and 3, aB7 for one with the label 'B', and the number itself for any other id.

    Examples
    --------
    >>> node_name((ord("x") << 56) + 3), node_name((ord("a") << 56) + (ord("B") << 48) + 7), node_name(1700), node_name(-1)
    ('x3', 'aB7', '1700', '-1')
    >>> node_name(id_of_key((ord("É") << 56) + 3))
    'É3'
    """
    key = key_of_id(node)
    character, label = key >> 56, key >> 48 & 0xFF
    named = (character in _CHARACTERS and (label in _LABELS or not label)) or (not character and label in _LABELS)
    if not named:
        return str(node)
    return f"{''.join(chr(byte) for byte in (character, label) if byte)}{key % (1 << 48)}"


def key_of_id(node: int) -> int:
    """GTSAM's key, from 0 to 2^64 - 1, of an id."""
    return node % (1 << 64)


def id_of_key(key: int) -> int:
    """The id, from -2^63 to 2^63 - 1, of a key of GTSAM; `key_of_id` gives the key back."""
    return (key + (1 << 63)) % (1 << 64) - (1 << 63)


def find_node(nodes: Iterable[int], wanted: int | str) -> int | None:
    """Index of the node with this id, key or name; None where there is none.

    Examples
    --------
    >>> find_node([7, ord("x") << 56], "x0"), find_node([7, 8], "8"), find_node([7, 8], 9)
    (1, 1, None)
    """
    text = str(wanted)
    return next((index for index, node in enumerate(nodes) if text in (str(node), str(key_of_id(node)), node_name(node))), None)
