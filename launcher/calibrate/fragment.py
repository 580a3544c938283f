"""A section of a scenario file, fitted to measurements, as TOML."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import isfinite
from typing import Any, Final

from launcher.calibrate.intervals import Fitted

_COMMENT_AT: Final = 36
"""The column of the comments, as in the files that Trackfield writes."""


@dataclass(frozen=True)
class Fragment:
    """A ``section`` with its ``keys``; ``fitted`` has the intervals of some, ``left`` says why others are not there.

    ``tables`` are keys whose values are fitted by sensor.
    """

    section: str
    keys: Mapping[str, Any]
    fitted: Mapping[str, Fitted]
    left: Mapping[str, str]
    about: Sequence[str]
    tables: Mapping[str, Mapping[str, Fitted]] = field(default_factory=dict)

    def toml(self) -> str:
        """The text of the section, with a comment for each key."""
        lines = [f"# {line}" for line in self.about] + [f"[{self.section}]"]
        for key, value in self.keys.items():
            lines.append(_line(key, value, self.fitted.get(key)))
        lines += [f"{f'# {key} = ...':{_COMMENT_AT - 2}}  # {why}" for key, why in self.left.items()]
        for name, table in self.tables.items():
            lines += ["", f"[{self.section}.{name}]"]
            lines += [_line(_bare(id), rounded(one.value), one) for id, one in table.items()]
        return "\n".join(lines) + "\n"


def rounded(value: float) -> float:
    """A number as it is written."""
    return float(f"{value:.4g}")


def _line(key: str, value: Any, interval: Fitted | None) -> str:
    comment = f"{interval.low:.4g} to {interval.high:.4g}" if interval else "as assumed"
    if interval and not isfinite(interval.high):
        comment = "no interval: it reported for a short time only"
    return f"{f'{key} = {json.dumps(value)}':{_COMMENT_AT - 2}}  # {comment}"


def _bare(id: str) -> str:
    """An id as a key of TOML."""
    return id if re.fullmatch(r"[A-Za-z0-9_-]+", id) else json.dumps(id)
