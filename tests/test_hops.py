"""Messages over several hops, each as one from its origin to its end."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import pytest

from launcher.record.figures.hops import end_to_end, hop_latencies, reports_end_to_end
from launcher.records import MessageRow
from trackfield.wire.codec import encode
from trackfield.wire.interests import Data
from trackfield.wire.messages import Doa, Hop
from trackfield.wire.outside import Captured, Carried
from trackfield.wire.passes import CpaReport, FixReport

REPORT = encode(CpaReport(7, 1.0, 0, -20.0, 1.0))


def frame(src: str, dst: str, sent_ns: int, message: Any, outcome: str = "delivered") -> MessageRow:
    """A frame of a field that takes 5 ns."""
    kind, medium = {Hop: ("hop", "field"), Data: ("data", "field"), Carried: ("carried", "backbone")}[type(message)]
    return MessageRow(kind, src, dst, medium, sent_ns, sent_ns + 5, outcome, 20, payload=encode(message))


def data(hops: int, payload: bytes = REPORT, sink: bytes = b"head") -> Data:
    return Data(sink, 0, b"n1", 3, hops, 0, payload)


def told(rows: Sequence[MessageRow]) -> list[tuple[Any, ...]]:
    return [(row.kind, row.src, row.dst, row.sent_ns, row.due_ns, row.outcome, row.step) for row in rows]


def test_data_is_one_message_from_its_origin_to_its_sink() -> None:
    rows = [
        frame("n1", "n2", 10, data(0), "radio"),
        frame("n1", "n2", 20, data(0)),
        frame("n2", "head", 30, data(1)),
        frame("n2", "head", 40, data(1), "ignored"),
    ]
    assert told(end_to_end((), rows)) == [("cpa-report", "n1", "head", 10, 35, "delivered", 7)]
    assert hop_latencies((), rows) == {}


def test_data_that_never_came_is_what_became_of_its_last_frame() -> None:
    first = frame("n1", "n2", 20, data(0))
    assert told(end_to_end((), [first])) == [("cpa-report", "n1", "n2", 20, None, "in_flight", 7)]
    lost = [first, frame("n2", "head", 30, data(1), "radio")]
    assert told(end_to_end((), lost)) == [("cpa-report", "n1", "head", 20, None, "radio", 7)]


def test_the_same_message_to_two_sinks_is_two() -> None:
    rows = [frame("n1", "head", 10, data(0)), frame("n1", "other", 20, data(0, sink=b"other"))]
    assert [row.dst for row in end_to_end((), rows)] == ["head", "other"]


def test_only_what_sensors_measured_is_a_report() -> None:
    fix = encode(FixReport(0, 7, 0, b"", b""))
    tree = Hop(b"n2", 0, 0, 1.0, b"", encode(Doa(3, 90.0, 60.0)))
    rows = [frame("n1", "head", 10, data(0, fix)), frame("n2", "base", 20, tree), frame("n1", "head", 30, data(0, b""))]
    assert [row.kind for row in end_to_end(["base"], rows)] == ["fix", "doa"]
    assert [row.kind for row in reports_end_to_end(["base"], rows)] == ["doa"]


def carried(hops: int, number: int = 3, origin: bytes = b"video") -> Carried:
    return Carried(origin, b"base", number, hops, encode(Captured(1, 40)))


def test_what_is_carried_over_a_backbone_is_one_message_and_counts_by_its_hops() -> None:
    rows = [
        frame("video", "hop1", 10, carried(0)),
        frame("hop1", "base", 30, carried(1)),
        frame("video", "hop1", 1010, carried(0, 4)),
        frame("hop1", "base", 1050, carried(1, 4)),
        frame("hop1", "base", 1060, carried(1, 4), "ignored"),
        frame("hop1", "base", 2000, carried(0, 3, b"hop1")),
        frame("video", "hop1", 3000, carried(0, 5)),
        frame("hop1", "base", 3030, carried(1, 5), "radio"),
    ]
    assert told(end_to_end((), rows)) == [
        ("captured", "video", "base", 10, 35, "delivered", None),
        ("captured", "video", "base", 1010, 1055, "delivered", None),
        ("captured", "hop1", "base", 2000, 2005, "delivered", None),
        ("captured", "video", "base", 3000, None, "radio", None),
    ]
    one, two = hop_latencies((), rows).values()
    assert one == pytest.approx({"n": 1, "p50": 5e-6, "p95": 5e-6})
    assert (two["n"], two["p50"]) == (2, pytest.approx(35e-6))
    assert reports_end_to_end((), rows) == []


def test_numbers_of_trees_interests_and_backbones_are_not_the_same() -> None:
    tree = Hop(b"video", 3, 0, 1.0, b"", encode(Doa(3, 90.0, 60.0)))
    rows = [frame("video", "base", 10, tree), frame("video", "base", 20, carried(0))]
    assert [row.kind for row in end_to_end(["base"], rows)] == ["doa", "captured"]
    assert hop_latencies(["base"], rows)["1"]["n"] == 2
