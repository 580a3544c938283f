"""What people, and ``trackfield control``, say to system control by lines of text, and what it answers.

A line is ``status``, ``status ID``, ``stop ID`` or ``start ID``, ended by CR, LF or both. It may begin with a tag, a
printable word that begins with ``#``: then the lines of its answer do, too. See docs/control.md.
"""

from __future__ import annotations

from dataclasses import dataclass
from re import split
from typing import Final

from trackfield.wire.outside import STATUS, VERBS
from trackfield.words import quoted

LONGEST: Final = 120
"""Bytes of a line; a longer one is not understood."""
END: Final = "end"
"""The last line of an answer that has one for each process."""
USAGE: Final = "status, status ID, stop ID or start ID is"
ANSWER_END: Final = b"\r\n"


@dataclass(frozen=True, slots=True)
class Asked:
    """A line that was understood: its ``verb``, for which process (empty: for each), and its tag."""

    verb: int
    id: str
    tag: str = ""


@dataclass(frozen=True, slots=True)
class Typed:
    """What of a line has come, and whether it is too long already."""

    begun: bytes = b""
    overlong: bool = False


def lines_of(state: Typed, data: bytes) -> tuple[Typed, list[str]]:
    """The lines that ``data`` completes, without those that are empty; of one that is too long the beginning."""
    *ended, begun = split(rb"[\r\n]+", data)
    lines = list[str]()
    for part in ended:
        line = _joined(state, part)
        state = Typed()
        text = line.begun.decode("ascii", "replace")
        if line.overlong or text.strip():
            lines.append(text + "..." * line.overlong)
    return _joined(state, begun), lines


def _joined(state: Typed, data: bytes) -> Typed:
    line = state.begun + data
    return Typed(line[:LONGEST], state.overlong or len(line) > LONGEST)


def understood(line: str) -> Asked | str:
    """What a line asks for, or what to answer if that cannot be said."""
    tag, words = "", line.split() if len(line) <= LONGEST else []
    if words and words[0].startswith("#") and words[0].isprintable():
        tag, *words = words
    verb = words[0].lower() if words else ""
    if verb in VERBS and (len(words) == 2 or (len(words) == 1 and verb == VERBS[STATUS])):
        return Asked(VERBS.index(verb), words[1] if len(words) == 2 else "", tag)
    return tagged(tag, f"not understood: {quoted(line)}; {USAGE}")


def tagged(tag: str, text: str) -> str:
    """A line of the answer to one with this tag."""
    return f"{tag} {text}" if tag else text
