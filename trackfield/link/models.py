"""The link models by name, as a scenario's ``[link]`` section names them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Final

from trackfield.link.fate import Link
from trackfield.link.fixed import Fixed
from trackfield.link.gilbert_elliott import GilbertElliott

__all__ = ["MODELS", "Link", "make_link"]


def ideal(seed: int) -> Link:
    """Loses nothing, takes 1 ms."""
    return Fixed(seed)


MODELS: Final[Mapping[str, Callable[..., Link]]] = {
    "ideal": ideal,
    "fixed": Fixed,
    "gilbert_elliott": GilbertElliott,
}


def make_link(spec: Mapping[str, Any], seed: int) -> Link:
    """The link of a ``[link]`` section: its ``model`` and that model's parameters.

    ``range_m`` says who hears whom, not what becomes of a frame, and is left to the caller. Raises
    ``ValueError`` for an unknown model or parameter, a missing one, or a value out of range.
    """
    parameters = {name: value for name, value in spec.items() if name not in ("model", "range_m")}
    name = str(spec.get("model"))
    if name not in MODELS:
        raise ValueError(f"link model {name!r} is not one of {', '.join(MODELS)}")
    try:
        return MODELS[name](seed, **parameters)
    except TypeError as error:
        raise ValueError(f"link {name}: {error}") from None
