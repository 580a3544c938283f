"""Which sensors a head has measure at the next step, and to whom it hands over."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import combinations
from math import comb, erf, hypot
from typing import Final

import numpy as np

from head.peers.memory import Leadership, Memory
from head.peers.settings import Settings
from trackfield.filters.types import Array, Gaussian
from trackfield.tracking.bank import Bank
from trackfield.tracking.selection import traces

MOST_SETS: Final = 2000
"""Of so many sets of sensors at most the best is found by trying all; of more, sensor by sensor."""
MOST_SILENT: Final = 3
"""A sensor that did not answer so many polls in a row is left alone for a while."""
PAUSE: Final = 4
"""That long, in steps."""
DEAF: Final = 2
"""So long one is left alone that senses no target."""
OUT_OF_REACH: Final = "nearer to the target, and out of reach: "
"""How a note on sensors begins that a head would rather ask."""
MOST_NOMINEES: Final = 2
"""To so many others, nearer to the target than itself, a head offers to hand over at a step."""


def peers_of(settings: Settings, memory: Memory) -> list[str]:
    """Itself, and those of whose announcements it heard at least half."""
    near = memory.near
    return [id for id in settings.numbers if id == settings.id or 2 * near.get(id, 0) >= settings.announcements]


def by_distance(bank: Bank, ids: Sequence[str], at: Array) -> list[str]:
    """These sensors, the one that is nearest to a state (n,) first; of equals the lower id."""
    x, y = float(at[0]), float(at[1])
    places = bank.positions
    return sorted(ids, key=lambda id: (hypot(places[id][0] - x, places[id][1] - y), id))


def away(bank: Bank, id: str, at: Array) -> float:
    """How far a sensor is from a state (n,), m."""
    return hypot(bank.positions[id][0] - float(at[0]), bank.positions[id][1] - float(at[1]))


def chosen(settings: Settings, bank: Bank, memory: Memory, leads: Leadership) -> tuple[str, ...]:
    """Who measures at the coming step, in the order of their slots; this node first, if it does, as it needs none."""
    step, known = leads.progress.step + 1, bank.ahead(leads.progress.tracks)
    peers = [id for id in peers_of(settings, memory) if leads.avoided.get(id, -1) < step]
    sensing = {id for id, until in memory.joined.items() if until >= step} | leads.came
    if memory.sensed.step >= leads.progress.step:
        sensing |= {settings.id}
    if known is None:  # it looks for a target around itself, first with those that said that they sense one
        x, y = bank.positions[settings.id]
        order = by_distance(bank, peers, np.array([x, y]))
        found = sorted(order, key=lambda id: id != settings.id and id not in sensing)[: settings.searching]
    else:
        order = by_distance(bank, peers, known[1].mean)
        found = order[: settings.count]
        if settings.joins:
            able = [id for id in order if id in sensing]
            best = smallest(bank, able, known[1], settings.count)
            found = [*best, *(id for id in order if id not in best)][: settings.count]
    return tuple(sorted(found, key=lambda id: id != settings.id))


def smallest(bank: Bank, ids: Sequence[str], ahead: Gaussian, count: int) -> list[str]:
    """So many of these sensors that together leave the smallest covariance of the predicted position.

    The information of each counts as far as it is likely to sense the target at all (``chances``). All sets are
    compared, or if they are too many, one sensor is added after the other.
    """
    if len(ids) <= count:
        return list(ids)
    D = chances(bank, ids, ahead)[:, None, None] * bank.information(ids, ahead.mean)
    J = np.linalg.inv(ahead.covariance)
    if comb(len(ids), count) <= MOST_SETS:
        sets = np.array(list(combinations(range(len(ids)), count)))
        return [ids[i] for i in sets[int(np.argmin(traces(J + D[sets].sum(axis=1))))]]
    taken, left = list[int](), list(range(len(ids)))
    while len(taken) < count:
        best = left.pop(int(np.argmin(traces(J + D[left]))))
        J = J + D[best]
        taken.append(best)
    return [ids[i] for i in taken]


def chances(bank: Bank, ids: Sequence[str], ahead: Gaussian) -> Array:
    """How likely (K,) the target is within the range of each of these sensors, by the predicted distance and its sd."""
    found = []
    for id in ids:
        x, y = (float(at - own) for at, own in zip(ahead.mean, bank.positions[id], strict=False))
        distance = max(hypot(x, y), 1e-9)
        towards = np.array([x, y]) / distance
        sd = float(towards @ ahead.covariance[:2, :2] @ towards) ** 0.5
        found.append(0.5 + 0.5 * erf((bank.kind(id).report_m - distance) / max(2.0**0.5 * sd, 1e-9)))
    return np.array(found)


def nominees(settings: Settings, bank: Bank, memory: Memory, leads: Leadership) -> list[str]:
    """Those to whom the head should hand over now, the best first; empty: it leads on.

    They must be awake, as those are that measured at this step.
    """
    known = bank.ahead(leads.progress.tracks)
    if known is None:
        return []
    at, me = known[1].mean, settings.id
    own = away(bank, me, at)
    if settings.keep_within_m is None:
        stays = _among_nearest(settings, bank, memory, leads, at)
        if stays and (settings.sticky or me == by_distance(bank, leads.chosen, at)[0]):
            return []
    elif own <= settings.keep_within_m:
        return []
    listening = (
        peers_of(settings, memory)
        if settings.always_on
        else [id for id in leads.asked if id in leads.came | leads.deaf]
    )
    nearer = [id for id in by_distance(bank, listening, at) if id != me and away(bank, id, at) < own]
    if settings.keep_within_m is None:  # of the new ones, as far as they listen
        nearer.sort(key=lambda id: id not in leads.chosen)
    return nearer[:MOST_NOMINEES]


def _among_nearest(settings: Settings, bank: Bank, memory: Memory, leads: Leadership, at: Array) -> bool:
    """Whether this node is one of the sensors that are nearest to a state (n,), those out of reach counted, too."""
    if settings.id not in leads.chosen:
        return False
    own, peers = away(bank, settings.id, at), set(peers_of(settings, memory))
    reached = [away(bank, id, at) for id in leads.chosen if id != settings.id]
    unheard = [away(bank, id, at) for id in settings.numbers if id not in peers]
    beyond = [hypot(x - float(at[0]), y - float(at[1])) for _, x, y in settings.beyond]
    return sum(one < own for one in (*reached, *unheard, *beyond)) < settings.count


def unreached(settings: Settings, bank: Bank, leads: Leadership) -> list[str]:
    """Sensors out of reach that are nearer to where the target will be than one of the chosen; for the log."""
    known = bank.ahead(leads.progress.tracks)
    if known is None or not leads.chosen:
        return []
    at = known[1].mean
    farthest = max(away(bank, id, at) for id in leads.chosen)
    return [id for id, x, y in settings.beyond if hypot(x - float(at[0]), y - float(at[1])) < farthest]


def missed(leads: Leadership) -> tuple[Mapping[str, int], Mapping[str, int]]:
    """Who did not answer how many polls in a row, and who is left alone for a while, up to which step.

    Those are the ones that did not answer for long, and the ones that just said that they sense no target.
    """
    step = leads.progress.step
    missing = {id: leads.missing.get(id, 0) + 1 for id in leads.asked if id not in leads.came | leads.deaf}
    avoided = {id: until for id, until in leads.avoided.items() if until > step}
    tired = [id for id, times in missing.items() if times >= MOST_SILENT]
    away = {**dict.fromkeys(tired, step + PAUSE), **dict.fromkeys(leads.deaf, step + DEAF)}
    return {id: n for id, n in missing.items() if id not in tired}, {**avoided, **away}
