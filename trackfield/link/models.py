"""The link models by name, as a scenario's ``[link]`` section names them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any, Final

from trackfield.link.csma154 import Csma154
from trackfield.link.fate import Link
from trackfield.link.fixed import Fixed
from trackfield.link.gilbert_elliott import GilbertElliott
from trackfield.link.lognormal_prr import LognormalPrr
from trackfield.link.places import Places
from trackfield.link.ranged import Ranged
from trackfield.link.trace import Trace

__all__ = ["MODELS", "Link", "make_link"]


def _ideal(seed: int, places: Places) -> Link:
    """Loses nothing, takes 1 ms."""
    return Fixed(seed)


def _ethernet(seed: int, places: Places, delay_ms: float = 1.0) -> Link:
    """A wire: loses nothing, constant delay."""
    return Fixed(seed, delay_ms=delay_ms)


def _anywhere(model: Callable[..., Link]) -> Callable[..., Link]:
    """A model that does not depend on places."""
    return lambda seed, places, **parameters: model(seed, **parameters)


MODELS: Final[Mapping[str, Callable[..., Link]]] = {
    "ideal": _ideal,
    "fixed": _anywhere(Fixed),
    "gilbert_elliott": _anywhere(GilbertElliott),
    "lognormal_prr": LognormalPrr,
    "csma154": _anywhere(Csma154),
    "ethernet": _ethernet,
    "trace": Trace,
}
"""Each makes a link from the seed, the places, and the section's keys."""


def make_link(spec: Mapping[str, Any], seed: int, places: Places = MappingProxyType({})) -> Link:
    """The link of a ``[link]`` section: its ``model``, that model's parameters, and ``range_m`` if it has an end.

    ``places`` holds the places of all processes between which frames may be sent. Raises ``ValueError`` for an unknown
    model or parameter, a missing one, or a value out of range.
    """
    parameters = {name: value for name, value in spec.items() if name not in ("model", "range_m")}
    name, range_m = str(spec.get("model")), spec.get("range_m")
    if name not in MODELS:
        raise ValueError(f"link model {name!r} is not one of {', '.join(MODELS)}")
    try:
        link = MODELS[name](seed, places, **parameters)
    except TypeError as error:
        raise ValueError(f"link {name}: {error}") from None
    return link if range_m is None else Ranged(link, places, range_m)
