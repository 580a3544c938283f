"""Measured delivery ratios, replayed under a radio (k7 files)."""

from __future__ import annotations

import gzip
import json
import random
from collections import Counter
from pathlib import Path
from typing import Any, Final

import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import binom

from launcher.plan.hardware import slowest_ns
from launcher.plan.plan import make_plan
from launcher.study.compare import differences
from tests.links import MS, TRACE, S, likely
from tests.running import both_ways
from trackfield.errors import ScenarioError
from trackfield.link import Fate, Link, make_link
from trackfield.link.fate import Transmission
from trackfield.link.k7 import COLUMNS, parse_k7
from trackfield.scenario import Scenario
from trackfield.scenario.packaged import packaged_data

HEAD: Final = '{"tx_length": 100, "interframe_duration": 100, "channels": [11, 12]}'
ON_AIR: Final = 106
"""Bytes of a recorded frame with preamble, delimiter and length."""
LINES: Final = """
2018-01-11T16:32:20.0,0,1,11,-69.9,0.8,100
2018-01-11T16:32:23.0,0,2,11,-88.5,0.3,100
2018-01-11T16:32:41.0,1,0,11,-70.1,0.5,100
2018-01-11T16:34:00.0,0,1,12,-70.9,0.4,100
2018-01-11T16:34:50.0,1,0,12,-70.1,1.0,100
2018-01-11T16:36:00.0,0,2,11,-88.5,0.1,100
2018-01-11T16:38:00.0,0,1,11,-69.9,0.6,100
"""
TEXT: Final = f"{HEAD}\n{COLUMNS}{LINES}"
NODES: Final = {"fusion": 47, "n007": 19, "n008": 31, "n015": 27, "n016": 46, "n017": 1, "n024": 13}
"""Of the packaged recording, for the sensors that report in ``zhai-spcpf`` with 75 m between them, some of them."""
GRENOBLE: Final = packaged_data("grenoble.k7.gz")


@pytest.fixture
def file(tmp_path: Path) -> Path:
    (tmp_path / "small.k7").write_text(TEXT)
    return tmp_path / "small.k7"


def link_of(file: Path, places: Any = None, seed: int = 1, **keys: Any) -> Link:
    return make_link({"model": "trace", "file": str(file), **keys}, seed, places or {})


def frame(src: str = "0", dst: str = "1", at_ns: int = 0, copy: int = 0, size: int = ON_AIR - 17) -> Transmission:
    """A frame as long as those recorded."""
    return Transmission(src, dst, "doa", at_ns, copy, size)


# --- which ratio holds ---


@pytest.mark.parametrize(
    ("t_s", "ratio"),
    [(0, 0.8), (219.999999999, 0.8), (220, 0.0), (339.999999999, 0.0), (340, 0.6), (1e9, 0.6)],
)
def test_a_window_of_a_channel_lasts_until_the_senders_next_burst(file: Path, t_s: float, ratio: float) -> None:
    """At 220 s node 1 has no line: it received nothing of what node 0 sent then, as node 2 shows."""
    link = link_of(file, only_channel=11)
    assert link.reception("0", "1", ON_AIR - 17, at_ns=round(t_s * S)) == pytest.approx(ratio)


@pytest.mark.parametrize(("t_s", "ratio"), [(0, 0.6), (99.9, 0.6), (100, 0.6), (220, 0.2), (340, 0.5)])
def test_without_a_channel_the_mean_of_what_holds_on_each(file: Path, t_s: float, ratio: float) -> None:
    """The first burst on channel 12, at 100 s, holds from the start."""
    assert link_of(file).reception("0", "1", ON_AIR - 17, at_ns=round(t_s * S)) == pytest.approx(ratio)


def test_a_run_may_start_anywhere_in_the_recording(file: Path) -> None:
    late = link_of(file, only_channel=11, start_s=200.5)
    shares = [late.reception("0", "1", ON_AIR - 17, at_ns=t) for t in (0, 19_500 * MS - 1, 19_500 * MS, 139_500 * MS)]
    assert shares == [pytest.approx(0.8), pytest.approx(0.8), 0, pytest.approx(0.6)]


def test_lines_of_one_burst_have_different_stamps(file: Path) -> None:
    """Node 2 heard its first frame three seconds later, so its line is of the same burst."""
    recording = parse_k7(TEXT, "small")
    assert [(burst.at_s, burst.channel, sorted(burst.heard)) for burst in recording.bursts["0"]] == [
        (0, 11, ["1", "2"]),
        (100, 12, ["1"]),
        (220, 11, ["2"]),
        (340, 11, ["1"]),
    ]
    assert recording.nodes == ("0", "1", "2")
    assert link_of(file, only_channel=11).reception("0", "2", ON_AIR - 17) == pytest.approx(0.3)


def test_links_without_data_receive_nothing(file: Path) -> None:
    link = link_of(file)
    for src, dst in (("2", "0"), ("1", "2"), ("0", "9"), ("9", "0"), ("0", "0"), ("0", "*")):
        assert link.reception(src, dst, 12) == 0
        assert link.fate(frame(src, dst)).cause == "radio"
        assert link.fate(frame(src, dst)).bytes_on_air == ON_AIR  # it was sent, all the same


def test_other_lengths_are_received_as_with_independent_errors_of_bytes(file: Path) -> None:
    link = link_of(file, only_channel=11)
    assert link.reception("0", "1", 12) == pytest.approx(0.8 ** (29 / 106))
    assert link.reception("0", "1", 116) == pytest.approx(0.8 ** (133 / 106))
    assert link.reception("0", "1", 200) == pytest.approx(0.8 ** ((133 + 101) / 106))  # in two frames


# --- the draws ---


@pytest.mark.parametrize(("channel", "ratio"), [(11, 0.8), (12, 0.4), (None, 0.6)])
@pytest.mark.parametrize("ack", [0, 1, 3])
def test_frames_arrive_with_their_ratio(file: Path, channel: int | None, ratio: float, ack: int) -> None:
    link, n = link_of(file, ack=ack, **({"only_channel": channel} if channel else {})), 20_000
    arrived = sum(link.fate(frame(copy=i)).cause is None for i in range(n))
    assert likely(arrived, binom(n, 1 - (1 - ratio) ** max(ack, 1)))
    assert link.reception("0", "1", ON_AIR - 17) == pytest.approx(1 - (1 - ratio) ** max(ack, 1))


def test_acknowledgements_have_the_ratio_of_the_way_back(file: Path) -> None:
    """Of the senders whose first transmission is received, those who are told of it stop."""
    link, n = link_of(file, only_channel=11, ack=2), 20_000
    attempts = Counter(link.fate(frame(copy=i)).attempts for i in range(n))
    told = 0.8 * 0.5 ** (11 / 106)
    assert likely(attempts[1], binom(n, told))
    unheard = link_of(file, only_channel=11, ack=2).fate(frame("0", "2"))
    assert unheard.attempts == 2  # nothing comes back from node 2


def test_the_instant_of_sending_decides_and_not_the_order_of_asking(file: Path) -> None:
    asked = [frame(src, dst, t * S, copy) for src, dst in ("01", "10", "02") for t in (0, 100, 219, 220, 400)
             for copy in range(20)]  # fmt: skip
    shuffled = random.Random(5).sample(asked, len(asked))
    one, other = link_of(file, ack=2), link_of(file, ack=2)
    told: dict[Transmission, Fate] = {each: other.fate(each) for each in shuffled}
    assert [one.fate(each) for each in asked] == [told[each] for each in asked]


def test_another_seed_and_another_medium_have_other_draws(file: Path) -> None:
    def causes(seed: int = 1, **keys: Any) -> list[str | None]:
        link = link_of(file, seed=seed)
        return [link.fate(frame(copy=i)._replace(**keys)).cause for i in range(50)]

    assert causes() == causes() != causes(seed=2)
    assert causes() != causes(medium="backbone")


def test_a_radio_takes_its_time(file: Path) -> None:
    fate = link_of(file, only_channel=12, ack=3).fate(frame("1", "0", 200 * S))
    assert fate.cause is None
    assert fate.bytes_on_air == ON_AIR
    assert fate.air_ns == ON_AIR * 32_000
    assert fate.delay_ns > fate.air_ns
    assert fate.busy_ns >= fate.delay_ns


# --- processes ---


def test_processes_are_nodes_by_the_mapping(file: Path) -> None:
    link = link_of(file, nodes={"a": "1", "b": "0"}, only_channel=11)
    assert link.reception("a", "b", ON_AIR - 17) == pytest.approx(0.5)
    assert link.reception("1", "0", ON_AIR - 17) == link.reception("a", "c", ON_AIR - 17) == 0


@given(st.sets(st.sampled_from("abcd"), min_size=1), st.booleans())
def test_a_process_that_keeps_its_own_links_has_the_same(few: set[str], mapped: bool) -> None:
    nodes = dict(zip("abcd", "2103", strict=True)) if mapped else dict(zip("0123", "0123", strict=True))
    ids = [id for id, other in zip(nodes, "abcd", strict=True) if other in few]
    whole, part = parse_k7(TEXT, "small"), parse_k7(TEXT, "small", {nodes[id] for id in ids})
    assert (part.nodes, part.channels, part.end_s) == (whole.nodes, whole.channels, whole.end_s)
    for src in part.bursts:
        assert [(burst.at_s, burst.channel) for burst in part.bursts[src]] == [
            (burst.at_s, burst.channel) for burst in whole.bursts[src]
        ]
        for mine, all_ in zip(part.bursts[src], whole.bursts[src], strict=True):
            assert mine.heard == {dst: heard for dst, heard in all_.heard.items() if dst in {nodes[i] for i in ids}}


def test_places_limit_what_is_kept(file: Path) -> None:
    link = link_of(file, {"a": (0.0, 0.0), "b": (0.0, 0.0)}, nodes={"a": "0", "b": "1", "c": "2"}, only_channel=11)
    assert link.reception("a", "b", ON_AIR - 17) == pytest.approx(0.8)
    assert link.reception("a", "c", ON_AIR - 17) == 0


def scenario(file: Path | str, **keys: Any) -> Scenario:
    settings = {f"link.{key}": value for key, value in keys.items()}
    return Scenario.load("zhai-spcpf", {"link.file": str(file), "field.spacing_m": 250.0, **settings})


def test_a_plan_gives_the_nodes_of_the_recording_in_order() -> None:
    """The centre comes first; the field has nine sensors."""
    assert GRENOBLE is not None
    link = make_plan(scenario(GRENOBLE), run="r").run.link
    assert link["nodes"] == {"fusion": "0", **{f"n{i:03}": str(i + 1) for i in range(9)}}


def test_an_id_that_is_that_of_a_node_is_that_node(tmp_path: Path) -> None:
    (tmp_path / "named.k7").write_text(TEXT.replace(",2,11", ",n001,11").replace(",1,1", ",7,1"))
    (tmp_path / "sensors.csv").write_text("id,x,y\nn001,0,0\n")
    settings = {"field": {"layout": "file", "file": str(tmp_path / "sensors.csv")}}
    one = scenario(tmp_path / "named.k7").set("field", settings["field"]).set("sensor.threshold", 0.6)
    link = make_plan(one, run="r").run.link
    assert link["nodes"] == {"fusion": "0", "n001": "n001"}


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ({"only_channel": 27}, "link.only_channel: 27 was not recorded; expected one of 11, 12"),
        ({"start_s": 341}, "link.start_s: 341 is after the end of the recording, at 340 s"),
        ({"nodes": {"fusion": "3"}}, "link.nodes: 'fusion': node '3' was not recorded"),
        ({"nodes": {"fusio": "1"}}, "link.nodes: there is no process 'fusio'; did you mean fusion"),
        ({"nodes": {"fusion": "1", "n000": "1"}}, "link.nodes: gives node '1' to several processes"),
        ({"nodes": 4}, "link.nodes: is 4; expected a table"),
        ({}, "has 3 nodes, and the run has 10 processes"),
    ],
)
def test_what_does_not_fit_a_recording(file: Path, keys: dict[str, Any], message: str) -> None:
    with pytest.raises(ScenarioError, match=message):
        make_plan(scenario(file, **keys), run="r")


@pytest.mark.parametrize(("key", "value"), [("only_channel", 11), ("start_s", 5.0), ("nodes", {"fusion": "n1"})])
def test_a_trace_of_frames_is_no_recording(key: str, value: Any) -> None:
    with pytest.raises(ScenarioError, match=rf"link\.{key}: .*k7"):
        make_plan(scenario(TRACE["file"], **{key: value}), run="r")


def test_a_trace_of_frames_has_no_radio() -> None:
    assert make_link({**TRACE, "ack": 3, "busy": 0.5}, 1).fate(frame("n1", "fusion")) == Fate(None, 2_500_000)
    assert slowest_ns(scenario(TRACE["file"], ack=3)) == 0


def test_what_sets_clocks_waits_for_repeats(file: Path) -> None:
    once, thrice = (slowest_ns(scenario(file, ack=ack)) for ack in (0, 3))
    assert 0 < 3 * once == thrice


# --- files ---


def changed(old: str, new: str) -> str:
    assert old in TEXT
    return TEXT.replace(old, new, 1)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("{", ":1: is not a JSON header"),
        (HEAD, ":2: is not the line datetime,src"),
        (f"{HEAD}\n{COLUMNS}\n", "has no lines after its header"),
        (changed('"tx_length": 100', '"tx_length": 0'), ":1: tx_length: 0 is not a number from 1 to 127"),
        (changed('"interframe_duration": 100, ', ""), ":1: interframe_duration: None is not a number"),
        (changed("-69.9,0.8", "-69.9,1.2"), ":3: pdr: 1.2 is not a number from 0 to 1"),
        (changed("-69.9,0.8", "-69.9,nan"), ":3: pdr: nan is not a number from 0 to 1"),
        (changed("-69.9,0.8", "nan,0.8"), ":3: mean_rssi: nan is not a number"),
        (changed("-69.9,0.8", "loud,0.8"), ":3: mean_rssi: 'loud' is not a number"),
        (changed("0.8,100", "0.8,0"), ":3: tx_count: '0' is not a whole number from 1"),
        (changed("0.8,100", "0.8"), ":3: has 6 cells, not the 7 of datetime"),
        (changed("16:32:23.0", "25:32:23.0"), ":4: datetime: '2018-01-11T25:32:23.0' is not a date"),
        (changed(",0,1,11", ",,1,11"), "'' is not the id of a node"),
        (changed("0,2,11", "0,1,11"), ":4: '1' is there twice in a burst of '0'"),
        (changed(",1,12", ",1,x"), ":6: channel: 'x' is not a whole number"),
    ],
)
def test_a_recording_that_cannot_be_used(tmp_path: Path, text: str, message: str) -> None:
    (tmp_path / "bad.k7").write_text(text)
    with pytest.raises(ValueError, match=message):
        link_of(tmp_path / "bad.k7")


def test_packed_recordings(tmp_path: Path, file: Path) -> None:
    packed = gzip.compress(TEXT.encode())
    (tmp_path / "any-name").write_bytes(packed)
    assert link_of(tmp_path / "any-name").fate(frame()) == link_of(file).fate(frame())
    for damaged, message in (
        (packed[:-20], "is cut off"),
        (packed[:40] + b"????" + packed[44:], "has damaged gzip data|is cut off"),
        (gzip.compress(b"\0" * (65 << 20)), "more than 64 MiB when unpacked"),
        (gzip.compress(b""), "no column src"),
    ):
        (tmp_path / "any-name").write_bytes(damaged)
        with pytest.raises(ValueError, match=message):
            link_of(tmp_path / "any-name")


def test_both_drivers_agree_on_the_packaged_recording(tmp_path: Path) -> None:
    settings = (
        "link.file=grenoble.k7.gz",
        f"link.nodes={{{', '.join(f'{id}={node}' for id, node in NODES.items())}}}",
        "link.start_s=50000",
        "link.ack=2",
        "field.spacing_m=75",
        "target.steps=30",
    )
    home = both_ways(tmp_path, "zhai-spcpf", *(part for one in settings for part in ("--set", one)), "--quiet")
    metrics = json.loads((home / "virtual" / "metrics.json").read_text())
    assert metrics["frames"]["delivered"] > 0
    assert metrics["frames"]["lost"]["radio"] > 0
    assert not differences(home / "virtual", home / "processes", 0.0)
