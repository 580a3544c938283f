"""Tables within tables, as scenarios and figures have them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any


def flat(values: Mapping[str, Any]) -> dict[str, Any]:
    """Every value by its path of keys, such as ``link.loss``; a list is one value, and an empty table has none."""
    found: dict[str, Any] = {}
    for key, value in values.items():
        if isinstance(value, Mapping):
            found |= {f"{key}.{path}": one for path, one in flat(value).items()}
        else:
            found[key] = value
    return found
