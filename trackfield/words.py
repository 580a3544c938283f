"""What others wrote, shown in a message: short, and without anything that a terminal would obey.

Only the standard library: nodes use it.
"""

from __future__ import annotations

from reprlib import Repr
from typing import Final

MOST: Final = 40
"""The number of characters of a value that a message shows."""
LONGEST: Final = 500
"""The number of characters of a part of a message."""

_BITS: Final = 128
_HIDDEN: Final = frozenset({"Cc", "Cf", "Cs", "Zl", "Zp"})
"""Kinds of characters that are obeyed instead of shown: controls, directions of writing, halves of pairs, new lines."""


class _Short(Repr):
    """Of a large value, only the beginning is looked at."""

    def __init__(self) -> None:
        super().__init__()
        self.maxlevel, self.maxstring, self.maxother, self.maxlong = 3, MOST, MOST, MOST

    def repr_int(self, x: int, level: int) -> str:
        """A very long one is not written out."""
        bits = x.bit_length()
        return repr(x) if bits <= _BITS else f"a whole number of {bits} bits"


_SHORT: Final = _Short()


def quoted(value: object) -> str:
    """The ``repr`` of a value, of a long one only its two ends."""
    return shortened(_SHORT.repr(value))


def shortened(text: str, most: int = MOST) -> str:
    """The text, with its middle left out if it has more than about ``most`` characters."""
    if len(text) <= most + 3:
        return text
    return f"{text[: most * 2 // 3]}...{text[-(most // 3) :]}"


def plain(text: str) -> str:
    """The text with characters escaped that a terminal obeys, and its middle left out if it is very long."""
    short = shortened(text, LONGEST)
    if short.isascii() and short.isprintable():
        return short
    import unicodedata  # only for odd texts: nodes do without

    return "".join(repr(c)[1:-1] if unicodedata.category(c) in _HIDDEN else c for c in short)
