"""messages.parquet and tracks.parquet: rows, their order, types, and what is not there."""

from __future__ import annotations

from dataclasses import asdict, replace
from itertools import product
from pathlib import Path as FilePath
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from launcher.record.ledger import Published
from launcher.record.tables import TrackRow, track_rows, write_messages, write_tracks
from launcher.record.views import seen
from launcher.records import MessageRow, View
from trackfield.role import NS, TrackPoint
from trackfield.world.path import Path

PATH = Path.of([(1.0, 10.0, 0.0, 2.0, 0.0), (4.0, 16.0, 0.0, 2.0, 0.0)])
PATHS = {"target": PATH}
COVARIANCE = tuple(float(i) for i in range(16))


def point(step: int, x: float | None = 1.0, *, tracker: str = "t", target: str = "target") -> TrackPoint:
    if x is None:
        return TrackPoint(tracker, target, step * NS, "waiting", step=step)
    return TrackPoint(
        tracker, target, step * NS, "tracking", (x, 2.0, 3.0, 4.0), COVARIANCE, tuple("abcde"), b"particles", step=step
    )


def message(sent_ns: int, src: str = "a", dst: str = "b", kind: str = "doa", copy: int = 0) -> MessageRow:
    return MessageRow(kind, src, dst, "field", sent_ns, sent_ns + 1, "delivered", 12, copy, 2, "words", (90.5, 70.0), 7)


def plain(row: MessageRow) -> dict[str, Any]:
    """As a table gives it."""
    return {**asdict(row), "values": list(row.values)}


# --- tracks -----------------------------------------------------------------------------------------------------------


def published(told_ns: int, point: TrackPoint, *, source: str = "fusion", incarnation: int = 0) -> Published:
    return Published(told_ns, source, incarnation, replace(point, source=source))


def test_the_last_estimate_of_a_step_counts() -> None:
    told = [published(100, point(1, 1.0)), published(200, point(2, 2.0)), published(300, point(1, 3.0), incarnation=1)]
    rows = track_rows(told, PATHS)
    found = [(row.point.step, row.told_ns, row.point.mean[0], row.incarnation) for row in rows]
    assert found == [(1, 100, 3.0, 1), (2, 200, 2.0, 0)]


def test_rows_are_in_the_order_of_sources_trackers_targets_steps() -> None:
    told = [
        published(n, point(step, tracker=tracker, target=target), source=source)
        for n, (step, target, tracker, source) in enumerate(product((10, 9), "yx", "ba", "ml"))
    ]
    rows = track_rows(told, PATHS)
    found = [(row.point.source, row.point.tracker, row.point.target, row.point.step) for row in rows]
    assert found == sorted(found)
    assert len(set(found)) == 16


def test_the_truth_is_that_of_the_points_instant() -> None:
    rows = track_rows([published(9, replace(point(1), at_ns=step * NS // 2)) for step in range(1, 12)], PATHS)
    assert [row.t_ns for row in rows] == [step * NS // 2 for step in range(1, 12)]
    assert rows[0].truth is None  # at 0.5 s it was not yet there
    assert rows[3].truth == (12.0, 0.0, 2.0, 0.0)
    assert rows[7].truth == (16.0, 0.0, 2.0, 0.0)
    assert rows[8].truth is None  # and at 4.5 s no more


def test_of_several_targets_the_nearest_is_the_truth() -> None:
    """One goes east from 10 m, the other stands at 13 m north: each point has its nearest."""
    paths = {**PATHS, "post": Path.of([(0.0, 0.0, 13.0, 0.0, 0.0), (1.5, 0.0, 13.0, 0.0, 0.0)])}
    rows = track_rows([published(9, point(step, x)) for step, x in ((1, 1.0), (2, 1.0), (3, None))], paths)
    assert [row.true_target for row in rows] == ["target", "target", "target"]
    reverse = {"post": paths["post"], **PATHS}
    assert [track_rows([published(9, point(1, None))], some)[0].true_target for some in (paths, reverse)] == [*paths]
    near = track_rows([published(9, replace(point(1), mean=(1.0, 12.0, 0.0, 0.0)))], paths)
    assert [(row.true_target, row.truth) for row in near] == [("post", (0.0, 13.0, 0.0, 0.0))]


def test_of_two_that_tell_of_an_instant_the_higher_term_is_seen() -> None:
    def told(source: str, step: int, term: int, told_ns: int) -> TrackRow:
        return TrackRow(told_ns, replace(point(step), source=source, term=term))

    rows = [told("b", 1, 2, 9), told("a", 1, 1, 5), told("a", 2, 3, 5), told("b", 2, 3, 9), told("c", 3, 9, 1)]
    found = [(row.point.source, row.point.step) for row in seen(rows, View("in-network", ("a", "b")))]
    assert found == [("b", 1), ("a", 2)]


def test_a_track_reads_back(tmp_path: FilePath) -> None:
    first_point = replace(point(1, None), source="fusion")
    second_point = replace(
        point(2), origin="head", unknowns=(-1.5,), unknown_sds=(0.5,), known_step=1, event_ns=NS + 5, refused="few"
    )
    rows = [
        TrackRow(1_300_000_000, first_point),
        TrackRow(2_300_000_000, second_point, (1.5, 2.5, 3.5, 4.5), "target", 1, interpolated=True),
    ]
    write_tracks(rows, {"": {2 * NS: 0.75}}, tmp_path / "tracks.parquet", origin_ns=NS // 2)
    first, second = pq.read_table(tmp_path / "tracks.parquet").to_pylist()
    empty = dict.fromkeys(("x", "y", "vx", "vy", "covariance", "true_x", "true_y", "true_vx", "true_vy", "true_target"))
    both = {"target": "target", "tracker": "t", "lag": 0, "term": 0}
    of_another = {
        "origin": "head",
        "unknowns": [-1.5],
        "unknown_sds": [0.5],
        "known_step": 1,
        "event_ns": NS + 5,
        "refused": "few",
    }
    assert first == {
        **both, "t_s": 0.5, "step": 1, "source": "fusion", "status": "waiting", "reports": 0, "told_s": 0.8,
        **empty, "bound_m": None, "sensors": [], "at_ns": NS, "told_ns": 1_300_000_000, "incarnation": 0,
        "true_interpolated": False, "origin": "", "unknowns": [], "unknown_sds": [], "known_step": None,
        "event_ns": None, "refused": "",
    }  # fmt: skip
    assert second == {
        **both, "t_s": 1.5, "step": 2, "source": "", "status": "tracking", "reports": 5, "told_s": 1.8,
        "x": 1.0, "y": 2.0, "vx": 3.0, "vy": 4.0, "covariance": list(COVARIANCE),
        "true_x": 1.5, "true_y": 2.5, "true_vx": 3.5, "true_vy": 4.5, "true_target": "target", "bound_m": 0.75,
        "sensors": list("abcde"), "at_ns": 2 * NS, "told_ns": 2_300_000_000, "incarnation": 1,
        "true_interpolated": True, **of_another,
    }  # fmt: skip


# --- messages ---------------------------------------------------------------------------------------------------------


def test_a_message_reads_back_whatever_it_lacks(tmp_path: FilePath) -> None:
    lost = MessageRow("doa", "a", "c", "field", 5, None, "radio", 12)
    write_messages([message(2**62), lost], tmp_path / "messages.parquet")
    assert pq.read_table(tmp_path / "messages.parquet").to_pylist() == [plain(lost), plain(message(2**62))]


def test_messages_are_in_the_order_of_sending_whatever_settled_first(tmp_path: FilePath) -> None:
    rows = [
        message(5, "a", "b"),
        message(5, "a", "c"),
        message(5, "a", "b", copy=1),
        message(5, "a", "b", kind="hello"),
        message(5, "b", "a"),
        message(6, "a", "a"),
    ]
    for n, order in enumerate((rows, rows[::-1], rows[3:] + rows[:3])):
        write_messages(order, tmp_path / f"{n}.parquet")
    first, second, third = (pq.read_table(tmp_path / f"{n}.parquet") for n in range(3))
    assert first.to_pylist() == [plain(row) for row in rows]
    assert first == second == third


# --- nothing to write -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("table", ["tracks", "messages"])
def test_a_table_without_rows_has_the_columns_of_one_with(tmp_path: FilePath, table: str) -> None:
    schemas = []
    for n in range(2):
        if table == "tracks":
            write_tracks([TrackRow(1, point(1), (1.0, 2.0, 3.0, 4.0))] * n, {}, tmp_path / f"{n}")
        else:
            write_messages([message(1)] * n, tmp_path / f"{n}")
        schemas.append(pq.read_schema(tmp_path / f"{n}"))
        assert pq.read_metadata(tmp_path / f"{n}").num_rows == n
    assert schemas[0] == schemas[1]
    assert not any(pa.types.is_null(type) for type in schemas[0].types)
