"""messages.parquet and tracks.parquet: rows, their order, types, and what is not there."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path as FilePath

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from launcher.record.tables import TrackRow, track_rows, write_messages, write_tracks
from launcher.records import MessageRow
from trackfield.role import NS, TrackPoint
from trackfield.world.path import Path

PATH = Path.of([(1.0, 10.0, 0.0, 2.0, 0.0), (4.0, 16.0, 0.0, 2.0, 0.0)])
COVARIANCE = tuple(float(i) for i in range(16))


def point(step: int, x: float | None = 1.0, *, tracker: str = "t", target: str = "target") -> TrackPoint:
    if x is None:
        return TrackPoint(tracker, target, step * NS, "waiting", step=step)
    return TrackPoint(
        tracker, target, step * NS, "tracking", (x, 2.0, 3.0, 4.0), COVARIANCE, tuple("abcde"), b"particles", step=step
    )


def message(sent_ns: int, src: str = "a", dst: str = "b", kind: str = "doa", copy: int = 0) -> MessageRow:
    return MessageRow(kind, src, dst, "field", sent_ns, sent_ns + 1, "delivered", 12, copy, 2, "words", 90.5, 7)


# --- tracks -----------------------------------------------------------------------------------------------------------


def test_the_last_estimate_of_a_step_counts() -> None:
    told = [(100, point(1, 1.0)), (200, point(2, 2.0)), (300, point(1, 3.0))]
    rows = track_rows(told, PATH, NS)
    assert [(row.point.step, row.told_ns, row.point.mean[0]) for row in rows] == [(1, 100, 3.0), (2, 200, 2.0)]


def test_rows_are_in_the_order_of_trackers_targets_steps() -> None:
    told = [
        (n, point(step, tracker=tracker, target=target))
        for n, (step, target, tracker) in enumerate((s, g, t) for s in (10, 9) for g in "yx" for t in "ba")
    ]
    found = [(row.point.tracker, row.point.target, row.point.step) for row in track_rows(told, PATH, NS)]
    assert found == sorted(found)
    assert len(set(found)) == 8


def test_the_truth_is_that_of_the_steps_instant() -> None:
    rows = track_rows([(9, point(step)) for step in range(1, 12)], PATH, NS // 2)
    assert [row.t_ns for row in rows] == [step * NS // 2 for step in range(1, 12)]
    assert rows[0].truth is None  # at 0.5 s it was not yet there
    assert rows[3].truth == (12.0, 0.0, 2.0, 0.0)
    assert rows[7].truth == (16.0, 0.0, 2.0, 0.0)
    assert rows[8].truth is None  # and at 4.5 s no more


def test_a_track_reads_back(tmp_path: FilePath) -> None:
    rows = [
        TrackRow(1_300_000_000, NS, point(1, None), None),
        TrackRow(2_300_000_000, 2 * NS, point(2), (1.5, 2.5, 3.5, 4.5)),
    ]
    write_tracks(rows, {2: 0.75}, tmp_path / "tracks.parquet")
    first, second = pq.read_table(tmp_path / "tracks.parquet").to_pylist()
    empty = dict.fromkeys(("x", "y", "vx", "vy", "covariance", "true_x", "true_y", "true_vx", "true_vy"))
    assert first == {
        "t_s": 1.0, "step": 1, "target": "target", "tracker": "t", "status": "waiting", "reports": 0, "told_s": 1.3,
        **empty, "bound_m": None,
    }  # fmt: skip
    assert second == {
        "t_s": 2.0, "step": 2, "target": "target", "tracker": "t", "status": "tracking", "reports": 5, "told_s": 2.3,
        "x": 1.0, "y": 2.0, "vx": 3.0, "vy": 4.0, "covariance": list(COVARIANCE),
        "true_x": 1.5, "true_y": 2.5, "true_vx": 3.5, "true_vy": 4.5, "bound_m": 0.75,
    }  # fmt: skip


# --- messages ---------------------------------------------------------------------------------------------------------


def test_a_message_reads_back_whatever_it_lacks(tmp_path: FilePath) -> None:
    lost = MessageRow("doa", "a", "c", "field", 5, None, "radio", 12)
    write_messages([message(2**62), lost], tmp_path / "messages.parquet")
    assert pq.read_table(tmp_path / "messages.parquet").to_pylist() == [asdict(lost), asdict(message(2**62))]


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
    assert first.to_pylist() == [asdict(row) for row in rows]
    assert first == second == third


# --- nothing to write -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("table", ["tracks", "messages"])
def test_a_table_without_rows_has_the_columns_of_one_with(tmp_path: FilePath, table: str) -> None:
    schemas = []
    for n in range(2):
        if table == "tracks":
            write_tracks([TrackRow(1, 1, point(1), (1.0, 2.0, 3.0, 4.0))] * n, {}, tmp_path / f"{n}")
        else:
            write_messages([message(1)] * n, tmp_path / f"{n}")
        schemas.append(pq.read_schema(tmp_path / f"{n}"))
        assert pq.read_metadata(tmp_path / f"{n}").num_rows == n
    assert schemas[0] == schemas[1]
    assert not any(pa.types.is_null(type) for type in schemas[0].types)
