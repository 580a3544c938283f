"""A section of a scenario file, fitted to measurements, as TOML."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

from launcher.calibrate.intervals import Fitted

_COMMENT_AT: Final = 36
"""The column of the comments, as in the files that Trackfield writes."""


@dataclass(frozen=True)
class Fragment:
    """A ``section`` with its ``keys``; ``fitted`` has the intervals of some, ``left`` says why others are not there."""

    section: str
    keys: Mapping[str, Any]
    fitted: Mapping[str, Fitted]
    left: Mapping[str, str]
    about: Sequence[str]

    def toml(self) -> str:
        """The text of the section, with a comment for each key."""
        lines = [f"# {line}" for line in self.about] + [f"[{self.section}]"]
        for key, value in self.keys.items():
            interval = self.fitted.get(key)
            comment = f"{interval.low:.4g} to {interval.high:.4g}" if interval else "as assumed"
            lines.append(f"{f'{key} = {json.dumps(value)}':{_COMMENT_AT - 2}}  # {comment}")
        lines += [f"{f'# {key} = ...':{_COMMENT_AT - 2}}  # {why}" for key, why in self.left.items()]
        return "\n".join(lines) + "\n"
