"""metrics.json: every key, exact figures of a tiny run, and never a figure that JSON does not have."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import fields, replace
from pathlib import Path as FilePath

import pytest

from launcher.record.journal import write_json
from launcher.record.ledger import Ledger
from launcher.record.metrics import Metrics, run_metrics, tracker_metrics
from launcher.records import MessageRow
from tests.simulated import simulated, spcpf
from tests.tiny import MS, point, tiny
from trackfield.drivers.engine.frames import Frame, Refused
from trackfield.drivers.exchange.histogram import Histogram
from trackfield.drivers.exchange.versions import digest
from trackfield.role import NS
from trackfield.wire.codec import encode
from trackfield.wire.messages import Doa

DOCUMENT = FilePath(__file__).parents[1] / "docs" / "metrics.md"


def expanded(keys: str) -> Iterator[str]:
    for key in keys.split():
        before, _, choices = key.partition("{")
        yield from (before + choice for choice in choices.rstrip("}").split(","))


KEYS = """
scenario seed driver ended_s complete end_reason wall_s cpu_s
trackers.<name>.rmse.{x,y,position,velocity}
trackers.<name>.{median_error,nees,nees_band,nees_position,nees_position_band,steps,bound_m,times_bound}
trackers.<name>.{verdict,lost,steps_expected,steps_tracked,share_within,longest_blackout_s}
trackers.<name>.gap.{rmse,steps} trackers.<name>.{detection_s,association}
trackers.<name>.targets.<id>.{rmse,steps} trackers.<name>.sources.<id> trackers.<name>.views.<view>
bound.{position,trajectory}
leaders.{per_step_mean,per_step_max,two_leader_steps,handovers,lost_handovers,take_overs,false_take_overs}
leaders.{dissolved,elections,split_elections,unwon_elections} leaders.election_s.{mean,max} leaders.healed_s.{mean,max}
leaders.{reports_used,reports_asked,out_of_reach_steps}
clusters.members.<master> clusters.{orphans_first,orphans_last,overheard}
passes.{events,enough}
passes.trackers.<name>.{fixes,false_fixes,fixes_per_pass,refused.<reason>,reports_used}
passes.trackers.<name>.location_m.{mean,max} passes.trackers.<name>.speed_m_s.{mean,max}
passes.trackers.<name>.heading_deg.{mean,max} passes.trackers.<name>.delay_s.{mean,max}
passes.trackers.<name>.base_delay_s.{mean,max}
camera.{fixes,shots,replaced} camera.outcomes.<outcome> camera.in_frame.{at_aim,aims,frames,frames_n,shots}
camera.delay_s.{mean,p95,max} camera.slew_s.{mean,p95,max} camera.first_seen_s.{mean,p95,max}
camera.place_m.{mean,p95,max} camera.pan_deg.{mean,p95,max} camera.tilt_deg.{mean,p95,max}
camera.lost.{times,s} camera.gateway.{passed,refused,dropped,unwanted,queue_max}
camera.orders.{ok,refused,unknown,silent} camera.refused_orders
camera.targets.<id>.{n,at_aim,aims,frames,frames_n,shots}
age_of_information_s.{mean,p95,base_mean,base_p95}
processes.{started,ready_s,died,stopped,pss_mb_per_node,unwritten}
frames.{sent,expected,delivered,late,duplicate,ignored}
frames.lost.{radio,partition,in_flight,asleep,frozen,dead,overflow,container}
frames.{host_lost,host_late} frames.refused.<reason> frames.by_kind.<kind>.{sent,payload_bytes_max}
frames.by_role.<role>.{delivered,ignored}
bytes.{payload,on_air}
channel.{use_mean,use_peak,use_limit,overlapped_share,captured_share,deaf_share,spared_share}
latency_ms.link.{p50,p95,p99,max} latency_ms.to_filter.{p50,p95,p99,max} latency_ms.to_track.{p50,p95,p99,max}
latency_ms.to_base.{p50,p95,p99,max}
latency_ms.hops.<hops>.{n,p50,p95}
host_latency_ms.{p50,p99}
timing.speed timing.slip_ms.{p50,p99} timing.{inversions,host_late,retractions}
timing.lag_ms.{p50,p99,max} timing.{unsettled,foreign_corrections}
energy_j.{total,max_node} energy_j.by.{send,receive,listen,sleep,sense}
energy_j.by_accounting.{metered,without_listening,with_overhearing,first_order}
energy_j.by_accounting.{cc2420,cc2420-20dbm,sx1276,wifi11b}
energy_j.by_role.<role>
awake_share.{mean,most}
ledger.setup.{s,bytes,total_j} ledger.setup.by.{sync,reports,control,overhear,listen,sleep,sense}
ledger.present.{s,bytes,total_j} ledger.present.by.{sync,reports,control,overhear,listen,sleep,sense}
ledger.settling.{s,bytes,total_j} ledger.settling.by.{sync,reports,control,overhear,listen,sleep,sense}
ledger.idle.{s,bytes,total_j} ledger.idle.by.{sync,reports,control,overhear,listen,sleep,sense}
ledger.power_w.{present,idle} ledger.{hottest,share_present} ledger.lifetime_s.{first_death,half_dead}
lifetime_s.{first_death,half_dead,coverage_lost,extrapolated,empty}
clock_error_ms.{rms,max}
recorder.{messages,dropped,complaints} interference.{frames,telemetry,answers,orders,tokens,questions}
interference.{denied,handshakes,sessions}
attempts.<certificate>.<kind>
"""
SOMETIMES = {
    "attempts.<certificate>.<kind>",
    *(f"frames.by_role.<role>.{what}" for what in ("delivered", "ignored")),
    *(f"latency_ms.hops.<hops>.{what}" for what in ("n", "p50", "p95")),
    "clusters.members.<master>",
    "passes.trackers.<name>.refused.<reason>",
    *(key for key in expanded(KEYS) if key.startswith("camera.")),
}
"""Of secured runs that were attacked (``test_hostile_secure.py``), of processes with several roles only
(``test_hosted_processes.py``), with a tree (``test_multihop.py``), with slaves (``test_clusters_figures.py``), with
sensors that report passes (``test_metrics_passes.py``), or with a camera (``test_metrics_camera.py``): without one that
key is null.
"""
SCORE = (
    *("rmse", "median_error", "nees", "nees_band", "nees_position", "nees_position_band"),
    *("steps", "bound_m", "times_bound", "verdict", "lost"),
    *("steps_expected", "steps_tracked", "share_within", "longest_blackout_s", "gap"),
    "detection_s",
)
"""What is told of each view."""


NAMES = {
    "trackers.": "<name>",
    "trackers.<name>.targets.": "<id>",
    "trackers.<name>.sources.": "<id>",
    "trackers.<name>.views.": "<view>",
    "frames.by_kind.": "<kind>",
    "frames.by_role.": "<role>",
    "clusters.members.": "<master>",
    "passes.trackers.": "<name>",
    "passes.trackers.<name>.refused.": "<reason>",
    "energy_j.by_role.": "<role>",
    "frames.refused.": "<reason>",
    "attempts.": "<certificate>",
    "attempts.<certificate>.": "<kind>",
}
"""What stands for the names that a run gives, by where they are."""


def paths(metrics: Metrics, before: str = "") -> Iterator[str]:
    """The path of each value, names of trackers, kinds and so on as in ``NAMES``; a view's figures are one value."""
    for name, value in metrics.items():
        key = f"{before}{NAMES.get(before, name)}"
        if isinstance(value, dict) and not key.endswith(".<view>"):
            yield from paths(value, f"{key}.")
        else:
            yield key


# --- the keys ---------------------------------------------------------------------------------------------------------


def test_every_key_is_there_and_no_other() -> None:
    plan = spcpf(1, ["target.steps=5", "targets=[{id='second', path='s3'}]"])
    ledger, tracks = simulated(plan)
    ledger.refuse("data/field/to/fusion/nobody/doa", "sender")
    metrics = run_metrics(plan, ledger, tracks)
    assert set(paths(metrics)) == set(expanded(KEYS)) - SOMETIMES | {"camera"}
    assert metrics["trackers"].keys() == {"imm-ukf", "spcpf"}
    assert metrics["frames"]["by_kind"].keys() == {"doa"}
    for tracker in metrics["trackers"].values():
        assert tracker["targets"].keys() == {"target", "second"}
        assert tracker["sources"].keys() == {"fusion"}
        assert tracker["views"] == {"base": {name: tracker[name] for name in SCORE}}


def test_every_key_is_there_in_a_run_in_which_nothing_happened() -> None:
    plan = tiny()
    metrics = run_metrics(plan, Ledger(plan.run, plan.processes), [])
    named = set(expanded("trackers.<name>.targets.<id>.{rmse,steps} trackers.<name>.sources.<id>"))
    named |= set(expanded("energy_j.by_role.<role>"))
    by_kind = set(expanded("frames.refused.<reason> frames.by_kind.<kind>.{sent,payload_bytes_max}"))
    assert set(paths(metrics)) == set(expanded(KEYS)) - named - by_kind - SOMETIMES | {"camera"}
    assert metrics["latency_ms"]["link"] == {"p50": None, "p95": None, "p99": None, "max": None}
    assert metrics["host_latency_ms"] == {"p50": None, "p99": None}
    nothing = {
        "rmse": {"x": None, "y": None, "position": None, "velocity": None},
        "median_error": None, "nees": None, "nees_band": None, "nees_position": None, "nees_position_band": None,
        "steps": 0, "bound_m": None, "times_bound": None,
        "verdict": "lost", "lost": True, "steps_expected": 4, "steps_tracked": 0, "share_within": 0.0,
        "longest_blackout_s": 4.0, "gap": {"rmse": None, "steps": 0}, "detection_s": None,
    }  # fmt: skip
    told = {"association": None, "targets": {}, "sources": {}, "views": {"base": nothing}}
    assert metrics["trackers"]["t"] == {**nothing, **told}


def table(heading: str) -> list[list[str]]:
    """The cells of the table under a heading of the document, without its two head rows."""
    text = DOCUMENT.read_text().partition(f"\n## {heading}\n")[2].partition("\n## ")[0]
    rows = [line.strip("| ").split(" | ") for line in text.splitlines() if line.startswith("|")]
    return [[cell.strip("` ") for cell in row] for row in rows[2:]]


def test_the_document_tells_each_key_in_their_order() -> None:
    rows = table("metrics.json")
    assert [row[0] for row in rows] == list(expanded(KEYS))
    for key, unit, meaning in rows:
        assert meaning
        suffix = key.partition(".")[0].rpartition("_")[2]
        units = {"s": ("s", ""), "ms": ("ms",), "j": ("J",)}.get(suffix, (unit,))
        assert unit in units or key.endswith(".n"), "a number of messages stands beside their times"


@pytest.mark.parametrize(("file", "which"), [("messages.parquet", "messages"), ("tracks.parquet", "tracks")])
def test_the_document_tells_each_column_of_the_tables(tmp_path: FilePath, file: str, which: str) -> None:
    import pyarrow.parquet as pq

    from launcher.record.tables import write_messages, write_tracks

    plan = spcpf(1, ["target.steps=3"])
    ledger, tracks = simulated(plan)
    if which == "messages":
        write_messages(ledger.rows, tmp_path / file)
    else:
        write_tracks(tracks, {}, tmp_path / file)
    columns = [[column.name, str(column.type)] for column in pq.read_schema(tmp_path / file)]
    plain = [[name, type.replace("&lt;", "<").replace("&gt;", ">")] for name, type, *_ in table(file)]
    assert plain == [[name, type.replace("element: ", "")] for name, type in columns]


def test_the_document_names_every_file_of_a_run_folder() -> None:
    text = DOCUMENT.read_text().partition("\n## ")[0]
    for file in ("scenario.toml", "target.gpx", "manifest.json", "run.rrd", "messages.parquet", "tracks.parquet",
                 "metrics.json", "logs/<process>.log"):  # fmt: skip
        assert f"`{file}`" in text


# --- a tiny run -------------------------------------------------------------------------------------------------------


def test_each_tracker_has_its_own_errors() -> None:
    tracks = [point(1, (3, 4, 0, 0)), point(2, (3, 4, 0, 0))]
    plan = tiny()
    plan = replace(plan, run=replace(plan.run, end_ns=3 * NS))
    found = tracker_metrics(replace(plan, info=replace(plan.info, trackers=("t", "other"))), tracks)
    assert (found["t"]["steps"], found["other"]["steps"]) == (2, 0)
    assert (found["t"]["verdict"], found["other"]["verdict"]) == ("tracked", "lost")


def test_a_whole_tiny_run() -> None:
    plan = tiny()
    ledger = Ledger(plan.run, plan.processes)
    payload = encode(Doa(1, 90.0, 60.0))
    assert len(payload) < 16
    sent = [
        Frame("n0", 0, "doa", 1000 * MS, 0, "fusion", "field", payload),  # delivered
        Frame("n1", 0, "doa", 1040 * MS, 0, "fusion", "field", payload),  # delivered
        Frame("n1", 0, "doa", 1400 * MS, 0, "fusion", "field", payload),  # late
        Frame("n0", 0, "doa", 4995 * MS, 0, "n1", "field", payload),  # in flight at the end
    ]
    for frame in sent:
        ledger.sent(frame)
    back = Frame("n0", 0, "doa", 1001 * MS, 0, "fusion", "field", b"")
    ledger.sent(back, 1)  # taken back: it is in no figure but those of the machine
    ledger.told("fusion", Refused(sent[2].key(1410 * MS), "late"))
    slip, latency, lag = Histogram(), Histogram(), Histogram()
    slip.add(2 * MS)
    latency.add(MS)
    both = {"slip": dict(slip.counts), "latency": dict(latency.counts)}
    lag.add(4 * MS)
    lag.add(9 * MS)
    ledger.foreign.add("fusion")
    heard = digest((frame, 0) for frame in sent[:3])
    ledger.final("fusion", {"heard": 3, "heard_hash": heard.total, "inversions": 2, "duplicate": 1, **both})
    ledger.final("n0", {"puts": 3, "sent": 2, "sent_hash": 0, "inversions": 1, "retractions": 2, **both})
    ledger.final("n1", {"puts": 5, "sent": 5, "sent_hash": 0, "host_late": 3, "lag": dict(lag.counts), **both})
    ledger.close()
    metrics = run_metrics(plan, ledger, [point(1, (3, 4, 0, 0)), point(2, (0, 0, 0, 1), told_ms=301)])

    assert (metrics["scenario"], metrics["seed"]) == ("tiny-scenario", 7)
    assert metrics["processes"]["started"] == 3
    assert metrics["frames"] == {
        "sent": 4, "expected": 4 + 3, "delivered": 3, "late": 1, "duplicate": 1, "ignored": 0,
        "lost": {
            "radio": 0, "partition": 0, "in_flight": 1, "asleep": 0, "frozen": 0, "dead": 0, "overflow": 0,
            "container": 0,
        },
        "host_lost": 3,  # n1 sent five, of which the recorder saw two
        "host_late": 0,
        "refused": {},
        "by_kind": {"doa": {"sent": 4, "payload_bytes_max": len(payload)}},
        "by_role": {},
    }  # fmt: skip
    assert metrics["bytes"]["payload"] == 4 * len(payload)
    assert metrics["latency_ms"] == {
        "link": dict.fromkeys(("p50", "p95", "p99", "max"), 10.0),
        # Step 1 was told at 1300 ms: 300 and 260 ms after its reports in time were sent.
        "to_filter": pytest.approx({"p50": 280.0, "p95": 298.0, "p99": 299.6, "max": 300.0}),
        "to_track": pytest.approx({"p50": 300.5, "p95": 300.95, "p99": 300.99, "max": 301.0}),
        "to_base": pytest.approx({"p50": 300.5, "p95": 300.95, "p99": 300.99, "max": 301.0}),
        "hops": {},
    }
    assert metrics["timing"] == {
        "speed": 2.0, "slip_ms": pytest.approx({"p50": 2.0, "p99": 2.0}, rel=0.026), "inversions": 3, "host_late": 3,
        "retractions": 2, "lag_ms": pytest.approx({"p50": 4.0, "p99": 9.0, "max": 9.0}, rel=0.026),
        "unsettled": 0, "foreign_corrections": 1,
    }  # fmt: skip
    assert metrics["host_latency_ms"] == pytest.approx({"p50": 1.0, "p99": 1.0}, rel=0.026)
    assert metrics["recorder"]["dropped"] == 3  # n1 sent 5, and 2 were seen


def test_what_the_host_lost_is_not_delivered() -> None:
    plan = tiny()
    ledger = Ledger(plan.run, plan.processes)
    sent = [Frame("n0", 0, "doa", t_ms * MS, 0, "fusion", "field", b"?") for t_ms in (100, 200, 300)]
    for frame in sent:
        ledger.sent(frame)
    heard = digest([(sent[1], 0)])
    ledger.final("fusion", {"heard": 1, "heard_hash": heard.total, "host_late": 1})
    ledger.close()
    metrics = run_metrics(plan, ledger, [])
    frames = metrics["frames"]
    assert [frames[key] for key in ("expected", "delivered", "host_lost", "host_late")] == [3, 1, 1, 1]
    assert metrics["timing"]["host_late"] == 1
    assert frames["expected"] == sum([frames["delivered"], *frames["lost"].values(), 1, 1])


def test_what_came_after_a_last_word_is_late_too() -> None:
    plan = tiny()
    ledger = Ledger(plan.run, plan.processes)
    ledger.final("fusion", {"heard": 0, "heard_hash": 0, "host_late": 0})
    ledger.sent(Frame("n0", 0, "doa", 100 * MS, 0, "fusion", "field", b"?"))
    ledger.close()
    metrics = run_metrics(plan, ledger, [])
    assert (metrics["frames"]["host_late"], metrics["timing"]["host_late"]) == (1, 1)


def test_in_virtual_time_nothing_is_taken_back() -> None:
    plan = spcpf(1, ["target.steps=3"])
    timing = run_metrics(plan, *simulated(plan))["timing"]
    nothing = dict.fromkeys(("retractions", "unsettled", "foreign_corrections"))
    assert timing | nothing == timing
    assert set(timing["lag_ms"].values()) == {None}


@pytest.mark.parametrize("settings", [["link.loss=0.3"], ["link.model=gilbert_elliott"], []])
def test_expected_is_delivered_and_lost(settings: list[str]) -> None:
    plan = spcpf(2, settings)
    frames = run_metrics(plan, *simulated(plan))["frames"]
    assert frames["expected"] == frames["delivered"] + sum(frames["lost"].values()) > 200
    assert frames["host_lost"] == 0
    assert (frames["lost"]["radio"] > 0) == bool(settings)


# --- figures that JSON does not have ----------------------------------------------------------------------------------


@pytest.mark.parametrize("value", [float("nan"), float("inf"), -float("inf")])
def test_no_file_is_written_with_what_is_no_number(tmp_path: FilePath, value: float) -> None:
    with pytest.raises(ValueError, match="JSON"):
        write_json({"a": {"b": [value]}}, tmp_path / "metrics.json")
    assert not (tmp_path / "metrics.json").exists()


def test_what_is_written_reads_back(tmp_path: FilePath) -> None:
    plan = spcpf(1, ["target.steps=5"])
    metrics = run_metrics(plan, *simulated(plan))
    write_json(metrics, tmp_path / "metrics.json")
    assert json.loads((tmp_path / "metrics.json").read_text()) == metrics


def test_a_row_of_messages_is_a_message_row() -> None:
    """The document's columns are the record's fields, in some order that both share."""
    assert [row[0] for row in table("messages.parquet")] == [field.name for field in fields(MessageRow)]
