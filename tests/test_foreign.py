"""Processes that are no part of Trackfield take places in runs: the examples of docs/foreign.md."""

from __future__ import annotations

import ast
import json
import sys
from collections import Counter
from itertools import count
from math import hypot
from pathlib import Path
from queue import SimpleQueue
from statistics import fmean
from types import SimpleNamespace
from typing import Any

import msgpack
import pyarrow.parquet as pq
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from launcher.processes.settling import answer_of
from launcher.record.samples import event_of, final_of
from tests.foreign import EXAMPLES, ended, examples, loaded, secured, started, waiting
from tests.peer_runs import scenario
from tests.running import PATIENCE_S, Run
from trackfield.drivers.engine.frames import Told
from trackfield.drivers.exchange.intake import nanoseconds
from trackfield.drivers.exchange.seal import TOKEN, Seal, token_from
from trackfield.role import Publish

__all__ = ["examples"]

FIELD = ("zhai-spcpf", "--nodes", "4", "--set", "field.spacing_m=150", "--set", "sensor.threshold=0.5")
STEPS = ("--set", "target.steps=8")
ID = "n002"
RANGE_SD_M = 2.3
"""The standard deviation of a range at the end of a sensor's reach in that field."""
SPEEDS = ("1", "0.3", "0.1")
"""Of runs with a head that cannot go back, until the machine keeps up."""
HEAD = "n012"
"""The node that is the nearest to the target at first."""


def rows(run: Run, table: str = "messages") -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = pq.read_table(run.folder / f"{table}.parquet").to_pylist()
    return found


def test_the_golden_vectors_are_what_is_sent_and_taken() -> None:
    """Those with seals: by the launcher, the recorder, and the example."""
    golden = json.loads((Path(__file__).parent / "golden" / "wire.json").read_text())["sealed"]
    plain = object.__new__(loaded("plain_node.py")["Plain"])
    plain.key = token_from({TOKEN: "abc"}, "demo")
    told = {vector["what"]: bytes.fromhex(vector["payload"]) for vector in golden}
    for vector in golden:
        payload, seal = told[vector["what"]], bytes.fromhex(vector["seal"])
        assert plain.seal(vector["subject"], payload, seal[:8]) == seal
        Seal(plain.key).check(vector["subject"], payload, seal)
    assert answer_of(told["an answer to the second wave"]) == (2, 0, {"fusion": 60}, False)
    assert answer_of(told["the same of one that sends final frames"]) == (2, 0, {}, False)
    assert final_of(told["the final record"]) == {"sent": 60, "puts": 60, "told": 0}
    assert nanoseconds(told["the end, after 5 s"]) == 5 * 10**9
    point = event_of(told["a point of a track"])
    assert isinstance(point, Told)
    assert isinstance(point.effect, Publish)
    assert point.effect.estimate.mean == (120.5, 95.25, 3.5, -0.75)


def test_they_need_nothing_of_ours() -> None:
    assert EXAMPLES.keys() == {"plain_node.py", "plain_head.py"}
    for code in EXAMPLES.values():
        nodes = list(ast.walk(ast.parse(code)))
        names = {alias.name for node in nodes if isinstance(node, ast.Import) for alias in node.names}
        names |= {str(node.module) for node in nodes if isinstance(node, ast.ImportFrom)}
        assert {name.partition(".")[0] for name in names} - sys.stdlib_module_names <= {
            "msgpack",
            "zenoh",
            "plain_node",
        }


@pytest.mark.parametrize("token", [pytest.param(None, marks=pytest.mark.long), "a secret of the field"])
def test_a_node_counts_as_any_other(
    examples: Path, tmp_path: Path, token: str | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its frames are those of the emulated node that it replaces, but for their noise, and all are accounted for."""
    monkeypatch.delenv(TOKEN, raising=False)
    if token is not None:
        monkeypatch.setenv(TOKEN, token)
    twin = Run(tmp_path / "twin", *FIELD, *STEPS, "--virtual")
    with waiting(tmp_path / "run", [ID], *FIELD, *STEPS) as (run, settings):
        node = started(examples, "plain_node.py", settings, ID, token)
        code, said = run.finish()
        assert ended(node) == (0, "")
    assert code == 0, said
    assert twin.finish()[0] == 0
    sent = [
        [(row["sent_ns"], row["dst"], row["kind"], row["step"]) for row in rows(one) if row["src"] == ID]
        for one in (run, twin)
    ]
    assert len(sent[0]) == 8
    assert sent[0] == sent[1]
    assert {row["outcome"] for row in rows(run) if row["src"] == ID} == {"delivered"}
    metrics = run.metrics()
    assert metrics["frames"]["host_lost"] == metrics["recorder"]["dropped"] == 0
    assert set(metrics["interference"].values()) == {0}
    assert {row["step"] for row in rows(run, "tracks") if ID in row["sensors"]} == set(range(1, 9))


def test_without_the_token_it_says_so(examples: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(TOKEN, "a secret of the field")
    with waiting(tmp_path / "run", [ID], *FIELD, *STEPS) as (run, settings):
        for wrong in (None, "another"):
            code, said = ended(started(examples, "plain_node.py", settings, ID, wrong))
            assert code == 1
            assert "TRACKFIELD_TOKEN" in said
            assert "Traceback" not in said
        assert "\nt = " not in run.said()


def test_a_place_that_is_taken_is_refused(examples: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Also one that the launcher starts itself, and one that there is not; the run is the same."""
    monkeypatch.delenv(TOKEN, raising=False)
    with waiting(tmp_path / "run", [ID], *FIELD, *STEPS) as (run, settings):
        refused = {"n001": "", "n009": ""}
        for id in refused:
            code, refused[id] = ended(started(examples, "plain_node.py", settings, id))
            assert code == 1
        first = started(examples, "plain_node.py", settings, ID)
        run.started()
        code, refused[ID] = ended(started(examples, "plain_node.py", settings, ID))
        assert code == 1
        assert run.finish()[0] == 0, run.said()
        assert ended(first) == (0, "")
    assert refused[ID] == f"{ID} is taken: a process lives there\n"
    assert all(said.count("\n") == 1 and "Traceback" not in said for said in refused.values()), refused
    assert sum(row["src"] == ID for row in rows(run)) == 8


def test_one_that_dies_is_missed_and_may_come_again(
    examples: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The next life goes on in its place, from a second after it came; the run says that one died."""
    monkeypatch.delenv(TOKEN, raising=False)
    with waiting(tmp_path / "run", [ID], *FIELD, "--set", "target.steps=15") as (run, settings):
        node = started(examples, "plain_node.py", settings, ID)
        run.started()
        node.kill()
        assert ended(node)[0] != 0
        again = started(examples, "plain_node.py", settings, ID)
        code, said = run.finish()
        assert ended(again) == (0, "")
    assert code == 1
    assert ID in said
    assert "Traceback" not in said
    lives = {row["incarnation"]: row["outcome"] for row in rows(run) if row["src"] == ID}
    assert lives[1] == "delivered"
    steps = [row["step"] for row in rows(run) if (row["src"], row["incarnation"]) == (ID, 1)]
    assert steps == list(range(steps[0], 16))
    assert run.metrics()["frames"]["refused"] == {}


def led(examples: Path, folder: Path, speed: str) -> Run:
    """A run in which an election picks a process of others; it went well."""
    field = (scenario(folder), "--set", "target.steps=14", "--set", "link.loss=0", "--speed", speed)
    with waiting(folder / f"run-{speed}", [HEAD], *field) as (run, settings):
        head = started(examples, "plain_head.py", settings, HEAD)
        code, said = run.finish(2 * PATIENCE_S)
        assert ended(head) == (0, "")
    assert code == 0, said
    return run


def used_all(run: Run) -> bool:
    """Whether the machine was so fast that all reports came to the head in time: it takes nothing back."""
    came = Counter(row["step"] for row in rows(run) if (row["dst"], row["kind"]) == (HEAD, "range"))
    return all(row["reports"] > came[row["step"]] for row in rows(run, "tracks") if row["source"] == HEAD)


def test_an_election_picks_one(examples: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It leads, its track is that of the run, and it hands over to a node of ours."""
    monkeypatch.delenv(TOKEN, raising=False)
    run = next(filter(used_all, (led(examples, tmp_path, speed) for speed in SPEEDS)), None)
    assert run is not None, "the machine is too slow"
    tracks = [row for row in rows(run, "tracks") if row["source"] != "base"]
    leader = {row["step"]: row["source"] for row in sorted(tracks, key=lambda row: row["term"])}
    assert sum(source == HEAD for source in leader.values()) >= 4
    assert leader[14] != HEAD
    kinds = Counter((row["kind"], row["outcome"]) for row in rows(run) if HEAD in (row["src"], row["dst"]))
    assert kinds["hand-over", "delivered"] == kinds["hand-over-ack", "delivered"] >= 1
    apart = [hypot(row["x"] - row["true_x"], row["y"] - row["true_y"]) for row in tracks if row["source"] == HEAD]
    assert fmean(apart) < RANGE_SD_M


def test_with_certificates(examples: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The one of another place gets no answer, and the run is the same."""
    monkeypatch.delenv(TOKEN, raising=False)
    with secured(tmp_path / "run", [ID], *FIELD, *STEPS) as (run, settings):
        code, told = ended(started(examples, "plain_node.py", settings("n001"), ID))
        assert (code, told.count("\n")) == (1, 1)
        assert "no answer" in told
        node = started(examples, "plain_node.py", settings(ID), ID)
        code, said = run.finish()
        assert ended(node) == (0, "")
    assert "Traceback" not in said
    assert {row["outcome"] for row in rows(run) if row["src"] == ID} == {"delivered"}
    assert sum(row["src"] == ID for row in rows(run)) == 8
    interference = run.metrics()["interference"]
    assert interference.pop("denied") > 0
    assert interference.pop("sessions") == 1  # n001 itself lives, and has one
    assert code == 1
    assert set(interference.values()) == {0}


class Deaf:
    """What ``plain_head.py`` needs of a session."""

    def put(self, key: str, payload: bytes, attachment: bytes = b"") -> None:
        assert key.startswith("data/field/")
        assert msgpack.unpackb(payload)[0] == 1
        assert len(attachment) == 28


def peer_of(kinds: dict[str, Any]) -> Any:
    """A node of the example that has joined, and leads in term 3."""
    peer = object.__new__(kinds["Peer"])
    peer.session, peer.id, peer.puts, peer.came, peer.told = Deaf(), "n001", Counter(), 0, 0
    peer.spec = {"cell": "c0", "incarnation": 0}
    peer.settings = {"loud_db": -13.0, "quiet_db": -39.0, "expiry_steps": 10, "keep_within_m": 45.0, "silent_steps": 3}
    peer.config, peer.election = {"step_ns": 10**9}, {"hop_ns": 2, "settle_ns": 4}
    peer.places = {f"n00{i}": complex(30 * i, 0) for i in range(4)}
    peer.here, peer.number, peer.tracker, peer.near, peer.heard = 30 + 0j, 1, "ukf", Counter(), SimpleQueue()
    peer.term, peer.alive_ns, peer.asked, peer.bids, peer.ranges = (3, "n001"), 0, (0, 0), [], {}
    peer.state, peer.silent, clock = (10 + 10j, 1j), 0, count(1, 10**7)
    peer.now, peer.until, peer.say = lambda: next(clock), lambda t_ns: True, lambda what, value: msgpack.packb(value)
    return peer


FIELDS = st.integers(-(2**40), 2**40) | st.binary(max_size=40) | st.none() | st.text(max_size=5) | st.floats()
KINDS = (
    "announce",
    "range",
    "claim",
    "join-claim",
    "poll",
    "estimate",
    "alive",
    "dissolve",
    "hand-over",
    "hand-over-ack",
)
BELIEF = msgpack.packb([2, 5, None, {"ukf": [1, 4, bytes(56)]}])
BELIEFS = st.just(BELIEF) | st.binary(max_size=60).map(lambda data: msgpack.packb([2, 5, None, {"ukf": [1, 4, data]}]))


@given(
    st.lists(
        st.tuples(
            st.sampled_from(KINDS), st.sampled_from(["n000", "n002", "?"]), st.lists(FIELDS | BELIEFS, max_size=5)
        )
        | st.tuples(st.sampled_from(KINDS), st.just("n002"), st.binary(max_size=30)),
        max_size=8,
    )
)
@settings(max_examples=200, deadline=None)
def test_no_frame_stops_a_head(frames: list[tuple[str, str, Any]]) -> None:
    """Whatever comes, it takes its next step, and contends again."""
    peer = peer_of(loaded("plain_head.py"))
    for kind, sender, told in frames:
        payload = told if isinstance(told, bytes) else msgpack.packb([1, 1, *told])
        sample = SimpleNamespace(
            key_expr=f"data/field/to/n001/{sender}/{kind}", payload=SimpleNamespace(to_bytes=lambda p=payload: p)
        )
        peer.heard.put(sample)
    assert peer.listen(40)
    assert peer.came == len(frames)
    peer.ranges["n000"] = (7, 20_000)
    peer.fuse(10**9, 7, 10**9)
    peer.contend(8, peer.now(), 20.0)
