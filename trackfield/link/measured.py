"""Links by their measured delivery ratios (``k7``), under the radio with which they were measured (IEEE 802.15.4)."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Mapping
from functools import partial
from math import fsum
from types import MappingProxyType
from typing import Final

from trackfield.link.fate import FIELD, Transmission
from trackfield.link.k7 import Burst, Recording
from trackfield.link.radios import RADIOS
from trackfield.link.transfer import ByRadio, Prr, Transfer
from trackfield.words import quoted

RADIO: Final = "802154-0dbm"
"""The radio that sends: k7 files are of IEEE 802.15.4."""


class Measured(ByRadio):
    """Each transmission is received with the ratio that was measured on its link.

    A burst's ratios hold from its begin until its sender's next one on the same channel; the first ones hold before
    that, too, and the last ones for ever. With ``only_channel`` None the mean over channels counts, of those ratios
    that hold, as for a radio that hops: each transmission is on any of the channels. The run begins ``start_s`` seconds
    after the recording. ``nodes`` gives processes the nodes whose links they have; None: an id is that of a node.

    A ratio is that of frames of the recording's length. As with independent errors of bytes, n bytes on the air are
    received with its power n / length: shorter frames, such as acknowledgements, have better chances.

    ``busy``, ``ack`` and ``acks`` as in ``Transfer``; acknowledgements have the ratio of the direction back. Raises
    ``ValueError`` for a channel or a node that the recording does not have, and for a start after its end.
    """

    def __init__(
        self,
        seed: int,
        recording: Recording,
        only_channel: int | None = None,
        start_s: float = 0.0,
        nodes: Mapping[str, str] | None = None,
        busy: float = 0.0,
        ack: int = 0,
        acks: Mapping[str, int] = MappingProxyType({}),
    ) -> None:
        _check(recording, only_channel, start_s, nodes or {})
        self._transfer = Transfer(seed, RADIOS[RADIO](0), busy, ack, acks)
        self._recording, self._channel, self._start_s, self._nodes = recording, only_channel, start_s, nodes
        # When which ratio begins to hold, of links in use; (times ns, ratios), the first time is before all.
        self._windows: dict[tuple[str, str], tuple[list[int], list[float]]] = {}

    def _prrs(self, frame: Transmission) -> tuple[Prr, Prr]:
        """See ``ByRadio``; the ratios at the instant of sending count for all of a frame's repeats."""
        ends = (frame.src, frame.dst), (frame.dst, frame.src)
        there, back = (partial(self._share, self.ratio(*two, frame.sent_ns)) for two in ends)
        return there, back

    def reception(
        self, src: str, dst: str, size: int, kind: str | None = None, at_ns: int = 0, medium: str = FIELD
    ) -> float:
        """See ``Link.reception``."""
        return self._transfer.reception(size, kind, partial(self._share, self.ratio(src, dst, at_ns)))

    def ratio(self, src: str, dst: str, at_ns: int) -> float:
        """The measured ratio that holds at an instant; 0 for a link that was not measured."""
        link = (src, dst)
        if link not in self._windows:
            self._windows[link] = self._of_link(*(self._node(id) for id in link))
        times, ratios = self._windows[link]
        return ratios[bisect_right(times, at_ns)]

    def _share(self, ratio: float, frame_bytes: int) -> float:
        """The share of frames of ``frame_bytes`` on the air that are received."""
        return float(ratio ** (frame_bytes / self._recording.frame_bytes))

    def _node(self, id: str) -> str | None:
        return id if self._nodes is None else self._nodes.get(id)

    def _of_link(self, src: str | None, dst: str | None) -> tuple[list[int], list[float]]:
        """When another ratio begins to hold (ns), and the ratios: the one before all of that, and one from each on."""
        if src is None or dst is None or src == dst:
            return [], [0.0]
        bursts = self._recording.bursts.get(src, ())
        sent = [burst for burst in bursts if self._channel in (None, burst.channel)]
        now = {burst.channel: _pdr(burst, dst) for burst in reversed(sent)}  # the first of each channel
        times, ratios = [], [_mean(now)]
        for burst in sent:
            now[burst.channel] = _pdr(burst, dst)
            times.append(round((burst.at_s - self._start_s) * 1e9))
            ratios.append(_mean(now))
        return times, ratios


def _pdr(burst: Burst, dst: str) -> float:
    heard = burst.heard.get(dst)
    return heard.pdr if heard else 0.0


def _mean(ratios: Mapping[int, float]) -> float:
    return fsum(ratios.values()) / len(ratios) if ratios else 0.0


def _check(recording: Recording, channel: int | None, start_s: float, nodes: Mapping[str, str]) -> None:
    if channel is not None and channel not in recording.channels:
        known = ", ".join(map(str, recording.channels))
        raise ValueError(f"only_channel: {channel} was not recorded; expected one of {known}")
    if start_s > recording.end_s:
        raise ValueError(f"start_s: {start_s:g} is after the end of the recording, at {recording.end_s:g} s")
    for id, node in nodes.items():
        if node not in recording.nodes:
            known = f"one of its {len(recording.nodes)} nodes, {recording.nodes[0]} to {recording.nodes[-1]}"
            raise ValueError(f"nodes: {quoted(id)}: node {quoted(node)} was not recorded; expected {known}")
