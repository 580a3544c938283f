"""record.log by itself: what is torn or damaged ends it, and never more than that; a disk that is full delays it."""

from __future__ import annotations

import errno
import fcntl
import os
from pathlib import Path

import msgpack
import pyarrow.parquet as pq
import pytest
from hypothesis import given
from hypothesis import strategies as st

from launcher import files
from launcher.files import PatientFile, patiently, whole_file
from launcher.record.kept.log import LOG, MAGIC, MARK, REFUSED, Entry, Log, Reading, frame
from launcher.record.kept.recovery import recovered
from tests.rrd import read as read_timeline
from tests.simulated import spcpf
from trackfield.drivers.engine.frames import RANK_TIMER, Told, Undone
from trackfield.drivers.exchange.telemetry import pack
from trackfield.errors import RunFailed
from trackfield.role import NS, Note
from trackfield.wire import keys
from trackfield.wire.codec import encode
from trackfield.wire.envelope import Envelope
from trackfield.wire.messages import Doa

entries = st.builds(Entry, st.text(max_size=20), st.binary(max_size=40), st.none() | st.binary(max_size=10))


def read(content: bytes, file: Path) -> tuple[list[Entry], bool]:
    file.write_bytes(content)
    reading = Reading(file)
    return list(reading), reading.damaged


@given(written=st.lists(entries, max_size=8), data=st.data())
def test_a_torn_log_is_a_prefix(
    written: list[Entry], data: st.DataObject, tmp_path_factory: pytest.TempPathFactory
) -> None:
    file = tmp_path_factory.getbasetemp() / "torn.log"
    content = MAGIC + b"".join(map(frame, written))
    cut = data.draw(st.integers(0, len(content)))
    found, damaged = read(content[:cut], file)
    assert found == written[: len(found)]
    ends = [len(MAGIC) + sum(len(frame(one)) for one in written[:n]) for n in range(len(written) + 1)]
    assert damaged == (cut not in ends)
    assert len(found) == sum(end <= cut for end in ends[1:])


@given(written=st.lists(entries, min_size=1, max_size=8), data=st.data())
def test_a_flipped_byte_ends_it_there(
    written: list[Entry], data: st.DataObject, tmp_path_factory: pytest.TempPathFactory
) -> None:
    file = tmp_path_factory.getbasetemp() / "flipped.log"
    content = bytearray(MAGIC + b"".join(map(frame, written)))
    at = data.draw(st.integers(0, len(content) - 1))
    content[at] ^= data.draw(st.integers(1, 255))
    found, damaged = read(bytes(content), file)
    whole = [n for n in range(len(written)) if len(MAGIC) + sum(len(frame(one)) for one in written[: n + 1]) <= at]
    assert damaged
    assert found == (written[: len(whole)] if at >= len(MAGIC) else [])


@pytest.mark.parametrize("content", [b"", b"PK\x03\x04", MAGIC + b"\xff" * 100, bytes(1000)])
def test_what_is_no_log_has_no_entries(content: bytes, tmp_path: Path) -> None:
    assert read(content, tmp_path / LOG) == ([], True)


def test_an_entry_by_hand_that_is_none_ends_it(tmp_path: Path) -> None:
    for content in (5, ["a"], {"a": 1}, [5, b"", None], ["a", "b", None], ["a", b"", 5]):
        made = frame(content)  # type: ignore[arg-type]
        assert read(MAGIC + made, tmp_path / LOG) == ([], True)


def test_entries_follow_the_mark_of_their_flush_and_refusals_are_counted(tmp_path: Path) -> None:
    log = Log(tmp_path)
    one = Entry("data/a", b"x", b"y")
    log.append(one)
    log.flush(7)
    for _ in range(3):
        log.refused("telemetry/ghost/final", "life")
    log.flush(9)
    reading = Reading(tmp_path / LOG)
    first, second, third, fourth = reading
    assert (first, second, third) == (Entry(MARK, b"7"), one, Entry(MARK, b"9"))
    assert fourth.key == REFUSED
    assert not reading.damaged


def test_a_full_disk_delays_what_is_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    log, true_write, room = Log(tmp_path), os.write, [40]

    def write(file: int, data: bytes) -> int:
        if not room[0]:
            raise OSError(errno.ENOSPC, "No space left on device")
        written = true_write(file, bytes(data[: room[0]]))
        room[0] -= written
        return written

    monkeypatch.setattr(files.os, "write", write)
    written = [Entry("data/a", bytes([n]) * 10) for n in range(5)]
    for n, one in enumerate(written):
        log.append(one)
        log.flush(n)
    assert log.outages == [(0, None, "No space left on device")]
    reading = Reading(tmp_path / LOG)
    assert [one for one in reading if one.key != MARK] == []
    assert reading.damaged
    room[0] = 10_000
    log.flush(5)
    assert log.outages == [(0, 5, "No space left on device")]
    reading = Reading(tmp_path / LOG)
    assert [one for one in reading if one.key != MARK] == written
    assert not reading.damaged


def test_a_file_that_is_written_is_locked(tmp_path: Path) -> None:
    file = PatientFile(tmp_path / "a")
    file.append(b"x")
    file.flush()
    with (tmp_path / "a").open("rb") as other, pytest.raises(BlockingIOError):
        fcntl.flock(other, fcntl.LOCK_SH | fcntl.LOCK_NB)
    file.close()
    assert (tmp_path / "a").read_bytes() == b"x"


def test_a_file_is_whole_or_as_it_was(tmp_path: Path) -> None:
    file = tmp_path / "a.json"
    file.write_text("old")
    with pytest.raises(ZeroDivisionError), whole_file(file) as part:
        part.write_text("half")
        raise ZeroDivisionError
    assert (file.read_text(), list(tmp_path.iterdir())) == ("old", [file])
    with whole_file(file) as part:
        part.write_text("new")
    assert (file.read_text(), list(tmp_path.iterdir())) == ("new", [file])


def test_only_what_may_pass_is_tried_again(monkeypatch: pytest.MonkeyPatch) -> None:
    tried: list[int] = []

    def write(number: int, times: int) -> None:
        tried.append(number)
        if len(tried) <= times:
            raise OSError(number, os.strerror(number))

    monkeypatch.setattr(files, "RETRY_EVERY_S", 0.0)
    patiently(lambda: write(errno.ENOSPC, 3), "it")
    assert len(tried) == 4
    tried.clear()
    with pytest.raises(RunFailed, match=r"^it could not be written \(Permission denied\)$"):
        patiently(lambda: write(errno.EACCES, 1), "it")
    monkeypatch.setattr(files, "RETRY_S", 0.0)
    with pytest.raises(RunFailed, match=r"^it could not be written \(No space left on device\)$"):
        patiently(lambda: write(errno.ENOSPC, 100), "it")


# --- what is made from it -----------------------------------------------------------------------------------------


def test_what_was_taken_back_is_not_recovered(tmp_path: Path) -> None:
    """In whatever order it stands in the log; neither tables nor timeline have it."""
    plan = spcpf(1, ["target.steps=5"])
    data, event = "data/field/to/fusion/n060/doa", "telemetry/n060/event"
    report = encode(Doa(1, 90.0, 60.0))
    log = Log(tmp_path)
    for entry in (
        Entry(keys.START, b"0"),
        Entry(data, b"", Envelope(NS, version=1).pack()),
        *(Entry(data, report, Envelope(t_ns, version=0).pack()) for t_ns in (NS, 2 * NS)),
        *(Entry(event, pack(Told((t_ns, RANK_TIMER, t_ns, "t"), Note(f"at {t_ns // NS}")))) for t_ns in (NS, 2 * NS)),
        Entry(event, pack(Undone((2 * NS, RANK_TIMER, 2 * NS, "t")))),
        Entry(keys.FINISH, msgpack.packb([])),
    ):
        log.append(entry)
    log.flush(5 * NS)
    metrics = recovered(plan, tmp_path)
    assert (metrics["frames"]["sent"], metrics["frames"]["expected"]) == (1, 1)
    assert pq.read_table(tmp_path / "messages.parquet")["sent_ns"].to_pylist() == [2 * NS]
    assert len(read_timeline(tmp_path / "run.rrd", "/messages/doa", "TextLog:text")) == 1
    notes = [text for _, (text,) in read_timeline(tmp_path / "run.rrd", "/notes", "TextLog:text")]
    assert [text for text in notes if text.startswith("n060")] == ["n060: at 1"]
