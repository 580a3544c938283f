"""What ``tests/same_as.py`` holds to be the same, on small tables."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import pyarrow as pa
import pytest

from launcher.plan.prepare import load, planned
from tests.same_as import HOST_LATE, Commands, Version, compared
from tests.same_cases import FIELDS, Case, cases, settings_of
from tests.same_tables import differences

POINT: dict[str, Any] = {
    "t_s": 1.0, "step": 1, "target": "target", "tracker": "ukf", "status": "tracking", "reports": 4,
    "x": 1.0, "y": 2.0, "vx": 0.0, "vy": -1.0, "covariance": [float(i) for i in range(16)],
}  # fmt: skip
FRAME: dict[str, Any] = {
    "kind": "doa", "src": "n060", "dst": "fusion", "medium": "field", "sent_ns": 10**9, "due_ns": 10**9 + 5,
    "outcome": "delivered", "bytes": 3, "copy": 0, "incarnation": 0, "payload": b"\x01\x02\x03", "text": "hello",
}  # fmt: skip
WAITING: dict[str, Any] = {
    "step": 2,
    "status": "waiting",
    "reports": 0,
    **dict.fromkeys(("x", "y", "vx", "vy", "covariance")),
}
Rows = list[dict[str, Any]]


def table(like: dict[str, Any], rows: Rows) -> pa.Table:
    return pa.Table.from_pylist([like | row for row in rows])


def of_tracks(old: Rows, new: Rows) -> list[str]:
    same = table(FRAME, [{}])
    values, frames = differences(table(POINT, old), table(POINT, new), same, same)
    assert frames == []
    return values


def of_frames(old: Rows, new: Rows) -> list[str]:
    same = table(POINT, [{}])
    values, frames = differences(same, same, table(FRAME, old), table(FRAME, new))
    assert values == []
    return frames


# --- tracks -----------------------------------------------------------------------------------------------------------


def test_equal_tracks_in_any_order_and_with_other_columns() -> None:
    assert of_tracks([{}, WAITING], [{**WAITING, "t_s": 7.0, "at_ns": 3}, {"at_ns": 4}]) == []


def test_one_bit_of_a_covariance() -> None:
    spread = [*map(float, range(15)), math.nextafter(15.0, 16.0)]
    assert of_tracks([{}], [{"covariance": spread}]) == [
        "ukf of target, step 1: covariance[15] 15.0, now 15.000000000000002"
    ]


def test_a_zero_has_a_sign_and_what_is_no_number_is_itself() -> None:
    assert of_tracks([{"x": math.nan}], [{"x": math.nan}]) == []
    assert of_tracks([{"vx": 0.0}], [{"vx": -0.0}]) == ["ukf of target, step 1: vx 0.0, now -0.0"]


def test_another_status_and_number_of_reports() -> None:
    assert of_tracks([{}], [{"status": "coasting", "reports": 0}]) == [
        "ukf of target, step 1: status 'tracking', now 'coasting'",
        "ukf of target, step 1: reports 4, now 0",
    ]


def test_a_track_that_begins_later() -> None:
    found = of_tracks([{"step": 2}], [WAITING])
    assert len(found) == 2 + 4 + 16
    assert found[2] == "ukf of target, step 2: x 1.0, now None"


def test_a_point_that_one_run_alone_has() -> None:
    assert of_tracks([{}, {"step": 2}], [{}]) == ["ukf of target, step 2: only in the old run"]
    assert of_tracks([{}], [{}, {}]) == ["ukf of target, step 1: only in the new run"]


@pytest.mark.parametrize("new", [{"tracker": "ukf+lag3"}, {"tracker": "ukf+lag3", "lag": 3}, {"lag": 3}])
def test_the_lag_of_a_smoothed_track_is_in_its_name_or_in_a_column(new: dict[str, Any]) -> None:
    old = [{}, {"tracker": "ukf+lag3", "x": 5.0}]
    assert of_tracks(old, [{"lag": 0}, {"x": 5.0, **new}]) == []
    assert of_tracks(old, [{"lag": 0}, {"x": 6.0, **new}]) == ["ukf lag 3 of target, step 1: x 5.0, now 6.0"]


# --- frames -----------------------------------------------------------------------------------------------------------


def test_equal_frames_in_any_order_and_with_other_columns() -> None:
    assert of_frames([{}, {}, {"sent_ns": 2}], [{"sent_ns": 2}, {}, {"text": "goodbye"}]) == []


def test_a_frame_more() -> None:
    assert of_frames([{}], [{}, {}]) == ["doa from n060 to fusion at 1.000000 s: only in the new run"]


def test_an_outcome_changed() -> None:
    late = {"sent_ns": 3 * 10**9, "outcome": "late"}
    assert of_frames([{}, late], [{"outcome": "radio", "due_ns": None}, {**late, "outcome": "delivered"}]) == [
        "doa from n060 to fusion at 1.000000 s: due_ns 1000000005, now None; outcome 'delivered', now 'radio'",
        "doa from n060 to fusion at 3.000000 s: outcome 'late', now 'delivered'",
    ]


@pytest.mark.parametrize("name", [name for name in FRAME if name != "text"])
def test_whatever_of_a_frame_is_another(name: str) -> None:
    value = FRAME[name]
    other = value + 1 if isinstance(value, int) else value + type(value)(value)
    assert of_frames([{}], [{name: other}]) != []


@pytest.mark.parametrize("name", ["step", "target", "tracker"])
def test_whichever_point_is_another(name: str) -> None:
    assert len(of_tracks([{}], [{name: 9 if name == "step" else "other"}])) == 2


def test_a_point_of_no_step_is_a_point() -> None:
    assert of_tracks([{"step": None}, {}], [{"step": None, "x": 2.0}, {}]) == ["ukf of target, step -1: x 1.0, now 2.0"]


# --- cases ------------------------------------------------------------------------------------------------------------


def test_each_case_has_a_name_of_its_own_and_settings_that_its_scenario_takes() -> None:
    some = list(cases())
    assert len({case.name for case in some}) == len({case.arguments for case in some}) == len(some) == 159
    assert [case.processes for case in some] == [False] * 155 + [True] * 4
    for name, field in FIELDS.items():
        for variant in field.variants:
            planned(load(field.scenario, settings=settings_of(name, variant)))


# --- versions ---------------------------------------------------------------------------------------------------------

PROGRAM = """
import json, sys
from pathlib import Path
import pyarrow as pa, pyarrow.parquet as pq
out = Path(sys.argv[sys.argv.index("--out") + 1])
out.mkdir()
for name, rows in {tables!r}.items():
    pq.write_table(pa.Table.from_pylist(rows), out / f"{{name}}.parquet")
late = {late!r}
metrics = {{"timing": {{"host_late": late}}, "frames": {{"host_lost": 0}}, "recorder": {{"dropped": 0}}}}
(out / "metrics.json").write_text(json.dumps(metrics))
sys.exit({code!r})
"""


def version(home: Path, name: str, *, x: float = 1.0, late: int = 0, code: int = 0) -> Version:
    """One whose every run comes to the same."""
    launcher = home / name / "launcher"
    launcher.mkdir(parents=True)
    (launcher / "__init__.py").touch()
    tables = {"tracks": [{**POINT, "x": x}], "messages": [FRAME]}
    (launcher / "cli.py").write_text(PROGRAM.format(tables=tables, late=late, code=code))
    (home / name / "runs").mkdir()
    return Version(name, home / name, home / name / "runs", Commands())


@pytest.mark.parametrize(
    ("new", "verdict"),
    [
        ({}, "same"),
        ({"x": 1.5}, "differ"),
        ({"code": 3}, "failed"),
        ({"late": 2}, HOST_LATE),
        ({"late": 2, "code": 1}, HOST_LATE),
    ],
)
def test_each_version_runs_by_its_own_code(new: dict[str, Any], verdict: str, tmp_path: Path) -> None:
    case = Case("one", ("bus",), processes=True)
    assert compared(case, version(tmp_path, "old"), version(tmp_path, "new", **new))[0] == verdict
