"""Clocks, energy, faults and all else around a field: what a scenario says of them, and each way to get it wrong."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from trackfield.errors import ScenarioError
from trackfield.scenario import Scenario, survey
from trackfield.scenario.faults import Kill
from trackfield.scenario.sections.clocks import Clocks
from trackfield.scenario.sections.energy import Energy
from trackfield.wire.registry import product_kinds

LEAST: dict[str, Any] = {"name": "mine", "target": {"path": "s1"}}


def failure(source: Any, overrides: dict[str, Any] | None = None) -> str:
    with pytest.raises(ScenarioError) as caught:
        Scenario.load(source, overrides)
    return str(caught.value)


# --- what is right ----------------------------------------------------------------------------------------------------


def test_what_is_left_out_is_right_and_lasts_for_ever() -> None:
    scenario = Scenario.load(LEAST)
    assert (scenario.clock, scenario.energy, scenario.faults) == (Clocks(), Energy(), ())
    assert not scenario.clock.off
    assert (scenario.restart, scenario.fusion.max_age_s, scenario.fusion.path) == ("never", 0.0, None)
    assert "faults" not in scenario.plain()


@pytest.mark.parametrize("key", ["offset_ms", "drift_ppm", "ramp_ppm_per_h"])
def test_a_clock_is_off_if_anything_of_it_is(key: str) -> None:
    assert Scenario.load(LEAST, {f"clock.{key}": 1}).clock.off


def test_faults_are_a_list_of_sections(tmp_path: Path) -> None:
    text = 'name = "mine"\n[target]\npath = "s1"\n[[faults]]\nkind = "kill"\nnodes = ["n060"]\nat_s = 20\n'
    (tmp_path / "mine.toml").write_text(text)
    scenario = Scenario.load(tmp_path / "mine.toml")
    assert scenario.faults == (Kill(nodes=("n060",), at_s=20.0),)
    assert Scenario.load(LEAST, {"faults": [{"kind": "kill", "nodes": ["n060"], "at_s": 20}]}) == scenario
    assert scenario.set("faults", []).faults == ()
    assert "[[faults]]\n" in scenario.to_toml()
    assert len({scenario, Scenario.load(tmp_path / "mine.toml")}) == 1


def test_a_threshold_is_a_share_or_adaptive_between_two() -> None:
    fixed = Scenario.load(LEAST, {"sensor.threshold": 0.5}).sensor.sensing
    assert (fixed.adaptive, fixed.thresholds, fixed.threshold) == (False, (35.0, 35.0), 35.0)
    adaptive = Scenario.load(LEAST, {"sensor.threshold": "adaptive", "sensor.threshold_min": 0.6}).sensor.sensing
    assert adaptive.adaptive
    assert adaptive.thresholds == pytest.approx((42.0, 56.0))
    assert (adaptive.threshold, adaptive.own.audible_db) == pytest.approx((49.0, 41.0))


def test_a_field_is_awake_for_the_lowest_threshold_that_may_come() -> None:
    adaptive = survey(Scenario.load("spcpf", {"sensor.threshold": "adaptive"}))
    assert adaptive.windows == survey(Scenario.load("spcpf", {"sensor.threshold": 0.70})).windows
    # 60 m away is out of range at 75 %, and within it at 70 %
    target = {"path": "waypoints", "waypoints": [[0, -60, 0], [10, -60, 100]]}
    assert survey(Scenario.load({**LEAST, "target": target}, {"sensor.threshold": "adaptive"})).steps == 10


def test_a_centre_stands_where_it_is_told_or_drives() -> None:
    drives = survey(Scenario.load(LEAST, {"fusion.path": [[5, 1, 2], [9.5, 3, 4]]}))
    assert drives.route == ((5 * 10**9, 1.0, 2.0), (9_500_000_000, 3.0, 4.0))
    assert drives.centre == (1.0, 2.0)
    assert survey(Scenario.load(LEAST, {"fusion.y_m": 7})).centre == (250.0, 7.0)
    assert survey(Scenario.load(LEAST)).route == ()


def test_acknowledgements_by_kind_are_a_value_whatever_their_order() -> None:
    kinds = [kind.name for kind in product_kinds()]
    links = [{"model": "csma154", "acks": dict.fromkeys(order, 2)} for order in (kinds, reversed(kinds))]
    first, second = (Scenario.load({**LEAST, "link": link}) for link in links)
    assert first == second
    assert first.plain()["link"]["acks"] == dict.fromkeys(kinds, 2)


# --- what is wrong ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("key", "value", "expected"),
    [
        ("restart", "always", "one of never, on-death"),
        ("clock.offset_ms", -1, "a number from 0 to 1e+09"),
        ("clock.drift_ppm", 1e5, "a number from 0 to 10000"),
        ("clock.ramp_ppm_per_h", 2000, "a number from -100 to 100"),
        ("clock.sync", "yes", "true or false"),
        ("clock.exchanges", 0, "a whole number from 1 to 1000"),
        ("clock.resync_s", 0, "a number from 0.1 to 1000000"),
        ("energy.device", "cc242", "one of cc2420, cc2420-20dbm, sx1276, wifi11b"),
        ("energy.battery_j", 0, "a number from 1e-06 to 1e+09"),
        ("energy.centre_battery_j", "full", "a number from 1e-06 to 1e+09"),
        ("energy.sample_mj", -1, "a number from 0 to 1e+09"),
        ("sensor.threshold", "adaptve", 'a number from 0 to 1, or "adaptive"'),
        ("sensor.threshold_min", 1.1, "a number from 0 to 1"),
        ("sensor.threshold_max", 0.6, "at least threshold_min, which is 0.7"),
        ("fusion.max_age_s", -1, "a number from 0 to 3600"),
        ("fusion.target_sd_m", 0, "a number from 0.001 to 10000000"),
        ("fusion.path", [[0, 1, 2]], "a list of at least two [t_s, x_m, y_m], with increasing times"),
        ("fusion.path", [[0, 1], [2, 3]], "a list of at least two [t_s, x_m, y_m], with increasing times"),
        ("link", {"model": "csma154", "queue": 0}, "a whole number from 1 to 10000"),
        ("link", {"model": "csma154", "acks": {"doa": -1}}, "a table of whole numbers from 0 to 100, like { doa = 4 }"),
        ("link", {"model": "csma154", "acks": {"doa": "x"}}, "a table of whole numbers from 0 to 100"),
        ("link", {"model": "lognormal_prr", "acks": 3}, "a table of whole numbers from 0 to 100"),
    ],
)  # fmt: skip
def test_a_value_out_of_range(key: str, value: Any, expected: str) -> None:
    message = failure(LEAST, {key: value})
    whole = {"queue", "acks"} & set(value) if isinstance(value, dict) else set()
    assert message.startswith(".".join([key, *whole]) + ": is ")
    assert f"; expected {expected}" in message


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"clock.synch": True}, "clock.synch: unknown; did you mean sync?; expected one of offset_ms, drift_ppm"),
        ({"energy.battery": 3}, "energy.battery: unknown; did you mean battery_j?"),
        ({"fault": []}, "fault: unknown; did you mean faults?"),
        (
            {"link": {"model": "ideal", "queue": 3}},
            "link.queue: belongs to model lognormal_prr or csma154 or serial or trace, not to ide",
        ),
        ({"fusion": {"path": [[0, 1, 2], [0, 3, 4]]}}, "fusion.path: its times do not increase (0 s follows 0 s); "),
        (
            {"fusion": {"path": [[0, 1, 2], [1, 3, 4]], "y_m": 3}},
            "fusion.y_m: is 3, but fusion.path also gives the centre's place; expected one of the two",
        ),
    ],
)  # fmt: skip
def test_what_is_unknown_or_contradicts_itself(values: dict[str, Any], message: str) -> None:
    assert failure(LEAST, values).startswith(message)


N = {"nodes": ["n001"]}


@pytest.mark.parametrize(
    ("faults", "message"),
    [
        (3, "faults: is 3; expected sections [[faults]]"),
        ({"kind": "kill"}, 'faults: is {"kind": "kill"}; expected sections [[faults]]'),
        ([3], "faults[0]: is 3; expected a section [[faults]]"),
        ([{**N, "at_s": 3}], "faults[0].kind: missing; expected one of kill, freeze, partition, restart, stuck, bias"),
        ([{"kind": "freez"}], "faults[0].kind: unknown kind 'freez'; did you mean freeze?; expected one of kill,"),
        ([{"kind": "kill", **N}], "faults[0].at_s: missing; expected a number from 0.001 to 1e+09"),
        ([{"kind": "kill", **N, "at_s": 0}], "faults[0].at_s: is 0; expected a number from 0.001 to 1e+09"),
        ([{"kind": "freeze", **N, "at_s": -1, "until_s": 3}], "faults[0].at_s: is -1; expected a number from 0 to"),
        ([{"kind": "kill", "at_s": 3}], "faults[0].nodes: affects no process; expected nodes (a list of ids), share"),
        ([{"kind": "kill", "at_s": 3, "nodes": []}], "faults[0].nodes: is []; expected a list of at least 1, each a t"),
        ([{"kind": "kill", "at_s": 3, "nodes": "n001"}], 'faults[0].nodes: is "n001"; expected a list of at least 1'),
        ([{"kind": "kill", "at_s": 3, "nodes": [1]}], "faults[0].nodes: is 1; expected a list of at least 1, each a"),
        ([{"kind": "kill", "at_s": 3, "nodes": ["a", "a"]}], "faults[0].nodes: 'a' is given twice; expected each id o"),
        ([{"kind": "kill", "at_s": 3, **N, "share": 0.1}], "faults[0].share: is given together with nodes; expected"),
        ([{"kind": "kill", "at_s": 3, "share": 0}], "faults[0].share: is 0; expected a number from 1e-06 to 1"),
        ([{"kind": "kill", "at_s": 3, "share": 1.1}], "faults[0].share: is 1.1; expected a number from 1e-06 to 1"),
        ([{"kind": "kill", **N, "at_s": 3, "until_s": 4}], "faults[0].until_s: belongs to kind freeze or partition or"),
        ([{"kind": "kill", **N, "at_s": 3, "nods": 4}], "faults[0].nods: unknown; did you mean nodes?; expected one o"),
        *(
            ([{"kind": kind, **N, "at_s": 3}], "faults[0].until_s: missing; expected a number")
            for kind in ("freeze", "partition", "restart")
        ),
        *(
            ([{"kind": kind, **N, "at_s": 3, "until_s": 3}], "faults[0].until_s: is 3; expected a time at least 0.001 ")
            for kind in ("freeze", "partition", "stuck", "deaf", "babble")
        ),
        (
            [{"kind": "restart", **N, "at_s": 3, "until_s": 3.9}],
            "faults[0].until_s: is 3.9; expected a time at least 1 s after at_s, which is 3",
        ),
        ([{"kind": "bias", **N, "at_s": 3}], "faults[0].bias_deg: is 0, and so is bias_db; expected at"),
        ([{"kind": "bias", **N, "at_s": 3, "bias_deg": 181}], "faults[0].bias_deg: is 181; expected a number from -18"),
        ([{"kind": "bias", **N, "at_s": 3, "bias_db": 101}], "faults[0].bias_db: is 101; expected a number from -100 "),
        ([{"kind": "stuck", **N, "at_s": 3, "bias_db": 1}], "faults[0].bias_db: belongs to kind bias, not to stuck"),
        ([{"kind": "clock_jump", **N, "at_s": 3}], "faults[0].jump_ms: missing; expected a number from -1e9 to 1e9, b"),
        ([{"kind": "clock_jump", **N, "at_s": 3, "jump_ms": 0}], "faults[0].jump_ms: is 0; expected a number from -1e"),
    ],
)  # fmt: skip
def test_a_fault_that_is_none(faults: Any, message: str) -> None:
    found = failure(LEAST, {"faults": faults})
    assert found.startswith(message)
    assert len(found.splitlines()) == 1


def test_each_fault_is_told_with_its_number_and_line(tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    file.write_text("""name = "mine"
[target]
path = "s1"

[[faults]]
kind = "kill"
nodes = ["n001"]
at_s = 5

[[faults]]   # no end
kind = "freeze"
share = 0.1
at_s = 5

[[ faults ]]
kind = "deaf"
share = "all"
at_s = -5
""")
    assert failure(file).splitlines() == [
        f"{file}:10: faults[1].until_s: missing; expected a number from 0.001 to 1e+09",
        f'{file}:17: faults[2].share: is "all"; expected a number from 1e-06 to 1',
        f"{file}:18: faults[2].at_s: is -5; expected a number from 0 to 1e+09",
    ]
    set_anew = failure(file, {"faults": [{"kind": "kil"}]})
    assert set_anew.startswith("faults[0].kind: unknown kind 'kil'; did you mean kill?")
