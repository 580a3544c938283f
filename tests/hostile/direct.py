"""Bad samples given to the parts of a run without a router."""

from __future__ import annotations

from collections.abc import Iterator


def feed(seed: int, count: int) -> Iterator[str]:
    """To be written."""
    yield from ()
