"""Run folders that are damaged, odd, or not finished: every command answers, or says in one message what is wrong."""

from __future__ import annotations

import json
import os
import re
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

import trackfield as tf
from launcher.record.figures.measures import RunFigures
from launcher.record.reading.columns import COLUMNS
from launcher.study.results import StudyRun
from tests.command_line import Call, trackfield
from tests.damaged_runs import STUDY, Ended, attempt, make_runs, wrong
from trackfield.errors import ScenarioError

__all__ = ["trackfield"]

TRIES = 40


@pytest.fixture(scope="module")
def home(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two short runs and a study; not to be spoilt."""
    folder = tmp_path_factory.mktemp("home")
    make_runs(folder)
    return folder


@pytest.fixture
def bad(home: Path, tmp_path: Path) -> Path:
    """A run to be spoilt, beside a good one."""
    shutil.copytree(home / "good", tmp_path / "good")
    return Path(shutil.copytree(home / "good", tmp_path / "bad"))


# --- drawn damages ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("part", range(4))
def test_each_damage_is_one_message_or_no_matter(home: Path, part: int) -> None:
    said = []
    for seed in range(1 + part * TRIES // 4, 1 + (part + 1) * TRIES // 4):
        done, end = attempt(home, seed)
        if bad := wrong(end, done):
            said.append(f"python -m tests.damaged_runs --tries 1 --seed {seed}: {done}: {bad}")
    assert not said, "\n".join(said)


@pytest.mark.parametrize(
    "end, what",
    [
        (Ended(0, "", ""), ""),
        (Ended(2, "", "trackfield: x: is 5\n"), ""),
        (Ended(2, "", ""), "not one message"),
        (Ended(2, "", "trackfield: a\ntrackfield: b\n"), "not one message"),
        (Ended(2, "", f"trackfield: {'x' * 2000}\n"), "not one message"),
        (Ended(0, "", "Traceback (most recent call last)"), "a traceback"),
        (Ended(2, "", "trackfield: \x1b[31m"), "control characters"),
        (Ended(0, "", "", "KeyError"), "KeyError"),
        (Ended(-11, "", ""), "exit code -11"),
        (Ended(1, "", "failed"), "exit code 1: failed"),
    ],
)
def test_what_is_wrong_is_found(end: Ended, what: str) -> None:
    assert wrong(end).startswith(what) and bool(wrong(end)) == bool(what)


# --- single damages ---------------------------------------------------------------------------------------------------


READING = (("report", "bad"), ("compare", "good", "bad"), ("replay", "bad", "--out", "again"))
OF_MANIFEST = (READING[0], ("compare", "good", "bad", "--html", "c.html"), READING[2], ("recover", "bad"))


def assert_said(trackfield: Call, what: str, *commands: tuple[str, ...]) -> None:
    """Each of these commands ends with this one message, and writes nothing."""
    for command in commands or READING:
        said = trackfield(*command)
        assert (said.code, said.out) == (2, ""), command
        assert re.fullmatch(f"trackfield: {what}\n", said.err), said.err
    assert not Path("again").exists()


def with_json(file: Path, change: Callable[[dict[str, Any]], object]) -> None:
    whole = json.loads(file.read_text())
    change(whole)
    file.write_text(json.dumps(whole))


def with_column(file: Path, name: str, change: Callable[[list[Any]], list[Any]]) -> None:
    table = pq.read_table(file)
    column = table[name]
    new = pa.array(change(column.to_pylist()), column.type)
    pq.write_table(table.set_column(table.column_names.index(name), name, new), file)


@pytest.mark.parametrize(
    "change, where, what",
    [
        (lambda m: m["frames"].update(delivered="many"), "frames.delivered", "is 'many'"),
        (lambda m: m["frames"].update(delivered=-1), "frames.delivered", "is -1"),
        (lambda m: m.update(complete=None), "complete", "is None"),
        (lambda m: m.update(trackers=[]), "trackers", r"is \[\]"),
        (lambda m: m["trackers"]["spcpf"]["rmse"].update(x=float("nan")), "trackers.spcpf.rmse.x", "is nan"),
        (lambda m: m.update(wall_s=1e308), "wall_s", r"is 1e\+308"),
        (lambda m: m.update(seed=2**64), "seed", "is 18446744073709551616"),
        (lambda m: m.update(driver="\x1b[31m" * 100), "driver", r"is '\\x1b\[31m.*'"),
        (lambda m: m.pop("timing"), "timing", "is missing"),
    ],
)
def test_a_figure_that_no_run_has_is_named(
    trackfield: Call, bad: Path, change: Callable[[dict[str, Any]], object], where: str, what: str
) -> None:
    with_json(bad / "metrics.json", change)
    expected = "the figures of a run by this version, whose recorder did not die"
    assert_said(trackfield, f"bad/metrics.json: {re.escape(where)}: {what}; expected {expected}")


@pytest.mark.parametrize(
    "content", [b"", b"{", b"[]", b"null", b"[" * 100_000, b"\xff\xfe", b'{"scenario": "\\ud800"}']
)
def test_figures_that_are_no_table_are_damaged(trackfield: Call, bad: Path, content: bytes) -> None:
    (bad / "metrics.json").write_bytes(content)
    assert_said(trackfield, "bad: its metrics.json is damaged; expected the folder of a finished run")


@pytest.mark.parametrize(
    "change, where, what",
    [
        (lambda m: m.update(started=5), "started", "is 5"),
        (lambda m: m.update(started="yesterday"), "started", "is 'yesterday'"),
        (lambda m: m.update(command=None), "command", "is None"),
        (lambda m: m.update(machine={}), "machine.system", "is missing"),
        (lambda m: m.update(versions=["x"]), "versions", r"is \['x'\]"),
        (lambda m: m.update(run=None), "run", "is None"),
        (lambda m: m.update(speed="fast"), "speed", "is 'fast'"),
        (lambda m: m.update(scenario=5), "scenario", "is 5"),
    ],
)
def test_a_manifest_that_no_run_has_is_named(
    trackfield: Call, bad: Path, change: Callable[[dict[str, Any]], object], where: str, what: str
) -> None:
    with_json(bad / "manifest.json", change)
    said = f"bad/manifest.json: {re.escape(where)}: {what}; expected the manifest of a run"
    (bad / "record.log").touch()
    assert_said(trackfield, said, *OF_MANIFEST)


@pytest.mark.parametrize("content", [b"", b"{", b"[]", b"[" * 200_000, b"\xff\xfe"])
def test_a_manifest_that_is_no_table_is_damaged(trackfield: Call, bad: Path, content: bytes) -> None:
    (bad / "manifest.json").write_bytes(content)
    (bad / "record.log").touch()
    assert_said(trackfield, "bad: its manifest.json is damaged; expected the folder of a finished run", *OF_MANIFEST)


@pytest.mark.parametrize(
    "table, column, change, what",
    [
        ("messages", "sent_ns", lambda v: [None, *v[1:]], "lacks a value; expected one in each row"),
        ("messages", "sent_ns", lambda v: [2**62, *v[1:]], "is 4.61169e.18; expected from -2.30584e.18 to 2.30584e.18"),
        ("messages", "outcome", lambda v: ["eaten", *v[1:]], "is 'eaten'; expected one of asleep, dead, .*"),
        ("messages", "dst", lambda v: ["zoo", *v[1:]], "names 'zoo', which is not there; expected those of .*"),
        (
            "messages",
            "due_ns",
            lambda v: [*v[:-1], 10**16],
            r"is 1[0,]+; expected 6,.* at most: the run ended at .*",
        ),
        (
            "tracks",
            "told_ns",
            lambda v: [*v[:-1], 10**16],
            r"is 1[0,]+; expected 6,.* at most: the run ended at .*",
        ),
        ("messages", "bytes", lambda v: [-1, *v[1:]], "is -1; expected from 0 to .*"),
        ("tracks", "source", lambda v: ["zoo", *v[1:]], "names 'zoo', which is not there; expected those of .*"),
        ("tracks", "origin", lambda v: ["zoo", *v[1:]], "names 'zoo', which is not there; expected those of .*"),
        ("tracks", "sensors", lambda v: [["zoo"], *v[1:]], "names 'zoo', which is not there; expected those of .*"),
        ("tracks", "sensors", lambda v: [[None], *v[1:]], "lacks a value inside a row; expected whole rows"),
        ("tracks", "covariance", lambda v: [[1.0], *v[1:]], "has 1 numbers in a row; expected 16"),
        ("tracks", "t_s", lambda v: [float("nan"), *v[1:]], "is not a number somewhere; expected finite numbers"),
        ("tracks", "status", lambda v: ["lost", *v[1:]], "is 'lost'; expected one of coasting, tracking, waiting"),
    ],
)
def test_a_value_in_a_table_that_no_run_has_is_named(
    trackfield: Call, bad: Path, table: str, column: str, change: Callable[[list[Any]], list[Any]], what: str
) -> None:
    with_column(bad / f"{table}.parquet", column, change)
    used = (
        (READING[0], READING[2])
        if table == "messages" or column in ("source", "origin", "sensors", "told_ns")
        else READING[:1]
    )
    assert_said(trackfield, f"bad/{table}.parquet: {column}: {what}", *used)


def test_a_column_of_another_type_is_named(trackfield: Call, bad: Path) -> None:
    table = pq.read_table(bad / "messages.parquet")
    place = table.column_names.index("sent_ns")
    pq.write_table(table.set_column(place, "sent_ns", table["sent_ns"].cast("string")), bad / "messages.parquet")
    assert_said(trackfield, "bad/messages.parquet: sent_ns: is a column of type string; expected int64")


def test_flipped_bits_in_a_table_are_found(bad: Path) -> None:
    """Pages have checksums: numbers that are merely others would be shown as those of the run."""
    file = bad / "tracks.parquet"
    whole = bytearray(file.read_bytes())
    column = pq.read_metadata(file).row_group(0).column(8)
    start = column.dictionary_page_offset or column.data_page_offset
    whole[start + column.total_compressed_size - 1] ^= 0x10
    file.write_bytes(whole)
    with pytest.raises(ScenarioError, match=r"its tracks\.parquet is damaged"):
        _ = tf.Result(bad).tracks


@pytest.mark.parametrize("name", ["metrics.json", "manifest.json", "scenario.toml", "tracks.parquet", "run.rrd"])
@pytest.mark.parametrize("make", [Path.mkdir, os.mkfifo, lambda file: file.symlink_to("/dev/zero")])
def test_what_is_no_file_is_not_read(trackfield: Call, bad: Path, name: str, make: Callable[[Path], object]) -> None:
    (bad / name).unlink()
    make(bad / name)
    command = ("view", "bad") if name == "run.rrd" else ("report", "bad")
    said = trackfield(*command)
    assert said.code == 2
    assert re.fullmatch(rf"trackfield: bad: (its {name} is not a file|has no timeline); expected .*\n", said.err)


def test_what_may_not_be_read_says_so(trackfield: Call, bad: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    opened = Path.open

    def refused(file: Path, *arguments: Any, **named: Any) -> Any:
        if file.parent.name == "bad":
            raise PermissionError(13, "Permission denied", str(file))
        return opened(file, *arguments, **named)

    monkeypatch.setattr(Path, "open", refused)
    assert_said(trackfield, r"bad: its metrics.json cannot be read \(Permission denied\); expected .*")


def test_the_tables_of_another_run_are_not_shown_as_those_of_this(trackfield: Call, home: Path, bad: Path) -> None:
    shutil.copy(home / "other" / "metrics.json", bad)
    said = "bad/metrics.json: scenario, seed: are 'zhai-spcpf' and 5; expected those of the run of its scenario.toml"
    assert_said(trackfield, said, ("report", "bad"))


def test_a_report_that_no_tracker_can_use_is_refused_before_anything_is_written(trackfield: Call, bad: Path) -> None:
    with_column(bad / "messages.parquet", "payload", lambda values: [b"\x00"] * len(values))
    said = r"bad/messages.parquet: payload: is no doa message where n\d+ reported on step 1; expected .*"
    assert_said(trackfield, said, READING[2])


@pytest.mark.parametrize("step", [0, 1_000_000_000])
def test_a_step_that_the_run_does_not_have_is_refused(trackfield: Call, bad: Path, step: int) -> None:
    """A replay would go through all steps up to there."""
    with_column(bad / "tracks.parquet", "step", lambda values: [step] * len(values))
    assert_said(trackfield, f"bad/tracks.parquet: step: is {step}; expected from 1 to .*", READING[2])


@pytest.mark.parametrize("name", ["scenario.toml", "record.log"])
@pytest.mark.parametrize("make", [Path.mkdir, os.mkfifo, lambda file: file.symlink_to("/dev/zero")])
def test_nothing_is_recovered_from_what_is_no_file(
    trackfield: Call, bad: Path, name: str, make: Callable[[Path], object]
) -> None:
    (bad / "record.log").touch()
    (bad / name).unlink()
    make(bad / name)
    (bad / "metrics.json").unlink()
    assert_said(
        trackfield, "bad(: has no record.log|/scenario.toml: is not the scenario of this run): .*", ("recover", "bad")
    )


# --- folders of runs that are not finished ----------------------------------------------------------------------------


def test_a_run_that_goes_on_or_was_killed_is_named_as_such(trackfield: Call, bad: Path) -> None:
    (bad / "metrics.json").unlink()
    assert_said(trackfield, "bad: has no metrics.json; expected the folder of a finished run")
    (bad / "record.log").write_bytes(b"")
    said = (
        "bad: has no metrics.json: its run still goes on, or was killed; expected the folder of a finished run; "
        "trackfield recover bad finishes it"
    )
    assert_said(trackfield, said)


def test_figures_of_a_run_whose_recorder_died_name_what_finishes_it(trackfield: Call, bad: Path) -> None:
    with_json(bad / "metrics.json", lambda metrics: metrics["frames"].update(sent=None))
    (bad / "record.log").write_bytes(b"")
    figures = "the figures of a run by this version, whose recorder did not die"
    said = f"bad/metrics.json: frames.sent: is None; expected {figures}; trackfield recover bad finishes it"
    assert_said(trackfield, said)


# --- what a run leaves is what is read --------------------------------------------------------------------------------


def test_what_runs_write_is_what_is_read(home: Path) -> None:
    for run in ("good", "other"):
        metrics = json.loads((home / run / "metrics.json").read_text())
        assert RunFigures.of(metrics).plain() == metrics
        for name, columns in COLUMNS.items():
            schema = pq.read_schema(home / run / name)
            assert {column.name: column.type for column in schema} == {key: one.type for key, one in columns.items()}


def test_a_record_that_broke_off_at_the_very_end_says_so_in_the_report(trackfield: Call, bad: Path) -> None:
    change = {"complete": False, "end_reason": "the launcher died"}
    with_json(bad / "metrics.json", lambda metrics: metrics.update(change))
    assert trackfield("report", "bad").code == 0
    text = (bad / "report.html").read_text()
    assert "ot all of the run was recorded (the launcher died)" in text


# --- studies ----------------------------------------------------------------------------------------------------------


def test_a_damaged_run_of_a_study_is_never_taken_for_another(home: Path, tmp_path: Path) -> None:
    file = next(home.glob("study/results/*/*.parquet"))
    whole, run = file.read_bytes(), StudyRun.load(file)
    refused = 0
    for at in range(0, len(whole), 101):
        other = tmp_path / "run.parquet"
        other.write_bytes(whole[:at] + bytes([whole[at] ^ 1]) + whole[at + 1 :])
        try:
            read = StudyRun.load(other)
        except ScenarioError:
            refused += 1
        else:  # the byte says nothing, such as one of the file's two copies of its metadata
            assert read.metrics == run.metrics
            assert read.tracks.equals(run.tracks)
    assert refused > len(whole) / 101 / 3


def test_a_damaged_run_of_a_study_is_named_with_what_to_do(trackfield: Call, home: Path, tmp_path: Path) -> None:
    shutil.copytree(home / "study", tmp_path / "study")
    first, second = sorted(tmp_path.glob("study/results/*/*.parquet"))
    whole = first.read_bytes()
    column = pq.read_metadata(first).row_group(0).column(0)
    page_ends = (column.dictionary_page_offset or column.data_page_offset) + column.total_compressed_size
    for content in (b"", whole[:-1], whole[: page_ends - 4] + b"xxxx" + whole[page_ends:]):
        first.write_bytes(content)
        said = trackfield(*STUDY)
        assert said.code == 2
        what = "the file to be deleted, so that the same command makes its run again"
        assert f"trackfield: {first.relative_to(tmp_path)}: is damaged; expected {what}" in said.err.replace(
            f"{tmp_path}/", ""
        )
    first.unlink()
    (tmp_path / "study" / "manifest.json").write_text('{"study": 5}')
    said = trackfield(*STUDY)
    assert said.code == 0
    assert "manifest.json is damaged" in said.err
    assert first.exists() and second.exists()
