"""The link models by name, as a scenario's ``[link]`` section names them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import inf
from types import MappingProxyType
from typing import Any, Final

from trackfield.link.bursty import Bursty
from trackfield.link.csma154 import Csma154
from trackfield.link.fate import Link
from trackfield.link.fixed import Fixed
from trackfield.link.gilbert_elliott import GilbertElliott
from trackfield.link.lognormal_prr import LognormalPrr
from trackfield.link.lossy import Lossy
from trackfield.link.places import Places
from trackfield.link.ranged import Ranged
from trackfield.link.serial import Serial
from trackfield.link.trace import trace
from trackfield.link.transfer import ByRadio

__all__ = ["MODELS", "Link", "make_link", "reach_m"]


def _ideal(seed: int, places: Places) -> Link:
    """Loses nothing, takes 1 ms."""
    return Fixed(seed)


def _ethernet(seed: int, places: Places, delay_ms: float = 1.0) -> Link:
    """A wire: loses nothing, constant delay."""
    return Fixed(seed, delay_ms=delay_ms)


def _anywhere(model: Callable[..., Link]) -> Callable[..., Link]:
    """A model that does not depend on places."""
    return lambda seed, places, **parameters: model(seed, **parameters)


WRAPPERS: Final = ("range_m", "burst_loss", "burst_s", "extra_loss")
"""Parameters of any model."""
BURST_S: Final = 4.0
"""The mean length of bursts where only their share is given."""

MODELS: Final[Mapping[str, Callable[..., Link]]] = {
    "ideal": _ideal,
    "fixed": _anywhere(Fixed),
    "gilbert_elliott": _anywhere(GilbertElliott),
    "lognormal_prr": LognormalPrr,
    "csma154": _anywhere(Csma154),
    "ethernet": _ethernet,
    "serial": _anywhere(Serial),
    "trace": trace,
}
"""Each makes a link from the seed, the places, and the section's keys."""


def reach_m(link: Link) -> float:
    """Beyond this distance (m) the link does not reach; infinite if it does not depend on distance."""
    match link:
        case Ranged():
            return min(link.range_m, reach_m(link.link))
        case Bursty() | Lossy():
            return reach_m(link.link)
        case LognormalPrr():
            return link.reach_m
    return inf


def make_link(
    spec: Mapping[str, Any],
    seed: int,
    places: Places = MappingProxyType({}),
    tx_dbms: Mapping[str, float] = MappingProxyType({}),
) -> Link:
    """The link of a ``[link]`` section: its ``model``, that model's parameters, ``range_m`` if it has an end,
    ``burst_loss`` and ``burst_s`` if it is bad at times, ``extra_loss`` if more is lost than by the model.

    ``places`` holds the places of all processes between which frames may be sent, ``tx_dbms`` the transmit powers of
    those that have their own; only a radio has one. Raises ``ValueError`` for an unknown
    model or parameter, a missing one, or a value out of range.
    """
    parameters = {name: value for name, value in spec.items() if name not in ("model", *WRAPPERS)}
    name, (range_m, burst_loss, burst_s, extra_loss) = str(spec.get("model")), map(spec.get, WRAPPERS)
    if name not in MODELS:
        raise ValueError(f"link model {name!r} is not one of {', '.join(MODELS)}")
    if tx_dbms and MODELS[name] is LognormalPrr:
        parameters["tx_dbms"] = tx_dbms
    try:
        link = MODELS[name](seed, places, **parameters)
    except TypeError as error:
        raise ValueError(f"link {name}: {error}") from None
    if extra_loss:
        link = link.lossier(extra_loss) if isinstance(link, ByRadio) else Lossy(seed, link, extra_loss)
    if range_m is not None:
        link = Ranged(link, places, range_m)
    return Bursty(seed, link, burst_loss, BURST_S if burst_s is None else burst_s) if burst_loss else link
