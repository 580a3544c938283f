"""Loading a scenario: what is right comes through, and all that is wrong is told at once, with its place."""

from pathlib import Path
from typing import Any, get_args

import pytest

from trackfield.errors import ScenarioError
from trackfield.link import MODELS, make_link
from trackfield.link.radios import RADIOS
from trackfield.link.shadowing import CHANNELS
from trackfield.scenario import Scenario, names, schema
from trackfield.scenario.layouts import AlongPath, Grid
from trackfield.scenario.links import LognormalPrr
from trackfield.scenario.packaged import ALIASES
from trackfield.scenario.paths import FromFile, Waypoints

LEAST: dict[str, Any] = {"name": "mine", "target": {"path": "s1"}}


def failure(source: Any, overrides: dict[str, Any] | None = None, **more: Any) -> str:
    with pytest.raises(ScenarioError) as caught:
        Scenario.load(source, overrides, **more)
    return str(caught.value)


def write(file: Path, text: str) -> Path:
    file.write_text(text)
    return file


# --- what is right -----------------------------------------------------------------------------------------


def test_a_name_and_a_target_are_enough() -> None:
    scenario = Scenario.load(LEAST)
    assert scenario.name == "mine"
    assert scenario.seed == 1
    assert isinstance(scenario.field, Grid)
    assert (scenario.field.spacing_m, scenario.field.extent_m) == (50.0, 500.0)
    assert (scenario.sensor.level_db, scenario.sensor.threshold, scenario.sensor.alpha) == (70.0, 0.75, 2.0)
    assert scenario.plain()["link"] == {"model": "ideal"}
    assert scenario.fusion.trackers == ("imm-ukf",)
    assert scenario.fusion.prior == "none"


def test_link_defaults_are_those_of_the_model() -> None:
    bursts = Scenario.load({**LEAST, "link": {"model": "gilbert_elliott"}}).plain()["link"]
    assert bursts.pop("model") == "gilbert_elliott"
    assert bursts.pop("bad_s") / (4 + bursts.pop("good_s")) == pytest.approx(0.074, abs=1e-4)
    assert bursts == {"loss_good": 0.0, "loss_bad": 1.0, "delay_ms": 20.0, "jitter_ms": 10.0}
    fixed = Scenario.load({**LEAST, "link": {"model": "fixed"}}).plain()["link"]
    assert fixed == {"model": "fixed", "loss": 0.05, "delay_ms": 5.0}


def test_a_radio_is_the_one_with_an_amplifier_unless_said_otherwise() -> None:
    link = Scenario.load({**LEAST, "link": {"model": "lognormal_prr"}}).plain()["link"]
    assert link == {"model": "lognormal_prr", "radio": "802154-20dbm", "busy": 0.0, "queue": 32}
    lora = Scenario.load({**LEAST, "link": {"model": "lognormal_prr", "radio": "lora868", "sf": 12}}).plain()["link"]
    assert lora["sf"] == 12


def test_a_scenario_names_the_radios_and_channels_that_there_are() -> None:
    fields = LognormalPrr.model_fields
    assert set(get_args(fields["radio"].annotation)) == set(RADIOS)
    assert {name for part in get_args(fields["channel"].annotation) for name in get_args(part)} == set(CHANNELS)


@pytest.mark.parametrize("model", sorted(set(MODELS) - {"trace"}))
def test_every_link_that_a_scenario_accepts_can_be_made(model: str) -> None:
    spec = Scenario.load({**LEAST, "link": {"model": model}}).plain()["link"]
    spec.pop("queue", None)  # of the process, not of the link
    link = make_link(spec, 1, {"a": (0.0, 0.0), "b": (1.0, 0.0)})
    assert 0.9 < link.reception("a", "b", 12) <= 1


def test_a_trace_lies_beside_the_scenario(tmp_path: Path) -> None:
    text = 'name = "mine"\n[target]\npath = "s1"\n[link]\nmodel = "trace"\nfile = "radio.csv"\n'
    assert Scenario.load(write(tmp_path / "mine.toml", text)).plain()["link"]["file"] == str(tmp_path / "radio.csv")


def test_levels_follow_from_threshold_and_margin() -> None:
    sensor = Scenario.load({**LEAST, "sensor": {"threshold": 0.5, "level_db": 80.0, "margin_db": 3.0}}).sensor
    assert (sensor.sensing.threshold, sensor.sensing.own.audible_db) == (40.0, 37.0)


def test_a_file_on_disk(tmp_path: Path) -> None:
    text = 'name = "mine"\n[target]\npath = "waypoints"\nwaypoints = [[0, 0, 0], [10, 5, 5.5]]\n'
    target = Scenario.load(write(tmp_path / "mine.toml", text)).target
    assert isinstance(target, Waypoints)
    assert target.waypoints == ((0.0, 0.0, 0.0), (10.0, 5.0, 5.5))


def test_a_target_file_lies_beside_the_scenario(tmp_path: Path) -> None:
    file = write(tmp_path / "mine.toml", 'name = "mine"\n[target]\npath = "file"\nfile = "tracks/ride.gpx"\n')
    for source in (file, str(file)):
        target = Scenario.load(source).target
        assert isinstance(target, FromFile)
        assert target.file == str(tmp_path / "tracks" / "ride.gpx")


def test_a_target_file_set_on_the_way_lies_in_the_working_directory(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    for scenario in (
        Scenario.load("bus", {"target.file": "ride.gpx"}),
        Scenario.load("bus").set("target.file", "ride.gpx"),
        Scenario.load({"name": "mine", "target": {"path": "file", "file": "ride.gpx"}}),
    ):
        assert scenario.plain()["target"]["file"] == str(tmp_path / "ride.gpx")


@pytest.mark.parametrize(
    ("written", "read"),
    [
        ("07:50:00", "07:50:00"),
        ('"07:50"', "07:50"),
        ("2024-05-06T07:50:00Z", "2024-05-06T07:50:00+00:00"),
        ("30", "30"),
    ],
)
def test_the_window_may_be_toml_times_or_text_or_seconds(tmp_path: Path, written: str, read: str) -> None:
    text = f'name = "mine"\n[target]\npath = "file"\nfile = "a.gpx"\nfrom = {written}\n'
    target = Scenario.load(write(tmp_path / "mine.toml", text)).target
    assert isinstance(target, FromFile)
    assert target.from_ == read


def test_a_scenario_never_changes() -> None:
    scenario = Scenario.load(LEAST)
    with pytest.raises(ValueError, match="frozen"):
        scenario.name = "yours"
    with pytest.raises(ValueError, match="frozen"):
        scenario.sensor.alpha = 3.0
    assert len({scenario, Scenario.load(LEAST)}) == 1  # a value: equal, hashable


def test_editors_get_a_schema() -> None:
    properties = schema()["properties"]
    sections = {
        "field",
        "sensor",
        "sensors",
        "target",
        "targets",
        "architecture",
        "camera",
        "fusion",
        "clock",
        "energy",
    }
    links = {"link", "backbone", "serial"}
    assert properties.keys() == {"name", "seed", "restart", "radio", "run", "score", "faults"} | sections | links
    assert set(properties["link"]["discriminator"]["mapping"]) == set(MODELS)
    layouts = {"grid", "jittered", "random", "ring", "pentagon", "along-path", "cells", "beside", "file"}
    assert set(properties["field"]["discriminator"]["mapping"]) == layouts
    sensor = schema()["$defs"]["DoaSensor"]
    assert sensor["properties"]["alpha"]["maximum"] == 20
    kinds = {"kill", "freeze", "partition", "restart", "stuck", "bias", "deaf", "babble", "clock_jump"}
    kinds |= {f"container-{what}" for what in ("kill", "restart", "pause", "disconnect")}
    assert set(properties["faults"]["items"]["discriminator"]["mapping"]) == kinds
    assert sensor["additionalProperties"] is False


# --- what is wrong -----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("section", "key", "value", "expected"),
    [
        ("field", "spacing_m", 0, "a number from 0.001 to 10000000"),
        ("field", "extent_m", -1, "a number from 0 to 10000000"),
        ("field", "nodes", 0, "a whole number from 1 to 200000"),
        ("field", "nodes", 2.5, "a whole number"),
        ("sensor", "threshold", 1.1, "a number from 0 to 1"),
        ("sensor", "threshold", -0.1, "a number from 0 to 1"),
        ("sensor", "level_db", 0, "a number from 0.001 to 200"),
        ("sensor", "alpha", 0.1, "a number from 0.5 to 20"),
        ("sensor", "doa_sd_deg", -3, "a number from 0.001 to 180"),
        ("sensor", "doa_sd_deg", float("nan"), "a number from 0.001 to 180"),
        ("sensor", "level_sd_db", float("inf"), "a number from 0 to 100"),
        ("sensor", "position_error_m", -1, "a number from 0 to 10000"),
        ("sensor", "position_error_m", float("inf"), "a number from 0 to 10000"),
        ("sensor", "margin_db", -1, "a number from 0 to 100"),
        ("sensor", "alpha", "2", "a number"),
        ("sensor", "alpha", True, "a number"),
        ("target", "steps", 0, "a whole number from 1"),
        ("target", "step_s", 0, "a number from 0.001 to 3600"),
        ("fusion", "deadline_s", 0, "a number from 0.001 to 1e+09"),
        ("fusion", "prior", "papers", "one of paper, none"),
        ("fusion", "prior_sd", [1, 2, 3], "a list of 4, each a number from 0.001 to 10000000"),
        ("fusion", "prior_sd", [1, 2, 3, 0], "a list of 4, each a number from 0.001 to 10000000"),
        ("fusion", "x_m", "left", "a number"),
        ("fusion", "trackers", [], "a list of at least 1"),
        ("fusion", "trackers", "spcpf", "a list of at least 1"),
    ],
)
def test_a_value_of_the_wrong_type_or_range(section: str, key: str, value: Any, expected: str) -> None:
    message = failure({**LEAST, "field": {"layout": "grid"}}, {f"{section}.{key}": value})
    assert message.startswith(f"{section}.{key}: is ")
    assert f"; expected {expected}" in message


@pytest.mark.parametrize(
    ("link", "key", "expected"),
    [
        ({"model": "fixed", "loss": 1.5}, "loss", "from 0 to 1"),
        ({"model": "fixed", "delay_ms": 0.5}, "delay_ms", "from 1 to 3600000"),
        ({"model": "gilbert_elliott", "good_s": 0}, "good_s", "from 0.001 to 1e+09"),
        ({"model": "gilbert_elliott", "loss_bad": 2}, "loss_bad", "from 0 to 1"),
        ({"model": "gilbert_elliott", "jitter_ms": -1}, "jitter_ms", "from 0 to 3600000"),
        ({"model": "ideal", "range_m": 0}, "range_m", "from 0.001 to 10000000"),
        ({"model": "ideal", "burst_loss": 0}, "burst_loss", "above 0"),
        ({"model": "ideal", "burst_loss": 1}, "burst_loss", "at most 0.99"),
        ({"model": "ideal", "burst_loss": 0.1, "burst_s": 0}, "burst_s", "from 0.001 to 1e+09"),
        ({"model": "ideal", "burst_s": 2}, "burst_s", "and burst_loss is unset; expected burst_loss as well"),
        ({"model": "ethernet", "delay_ms": 0.5}, "delay_ms", "from 1 to 3600000"),
        ({"model": "lognormal_prr", "radio": "802154-10dbm"}, "radio", "did you mean 802154-0dbm?; expected one of"),
        ({"model": "lognormal_prr", "channel": "uscc"}, "channel", "did you mean usc?; expected one of castalia"),
        ({"model": "lognormal_prr", "radio": "lora868", "sf": 13}, "sf", "from 7 to 12"),
        ({"model": "lognormal_prr", "sf": 9}, "sf", "802154-20dbm has no spreading factor; expected no spreading"),
        ({"model": "lognormal_prr", "tx_dbm": 41}, "tx_dbm", "from -60 to 40"),
        ({"model": "lognormal_prr", "noise_dbm": 1}, "noise_dbm", "from -180 to 0"),
        ({"model": "lognormal_prr", "busy": 1}, "busy", "from 0 to 0.99"),
        ({"model": "lognormal_prr", "ack": -1}, "ack", "a whole number from 0 to 100"),
        ({"model": "csma154", "ack": 2.5}, "ack", "a whole number from 0 to 100"),
        ({"model": "trace", "file": ""}, "file", "a text"),
    ],
)
def test_a_link_out_of_range(link: dict[str, Any], key: str, expected: str) -> None:
    message = failure({**LEAST, "link": link})
    assert message.startswith(f"link.{key}: is ")
    assert expected in message


@pytest.mark.parametrize(
    ("field", "key", "expected"),
    [
        ({"layout": "jittered", "jitter": -0.1}, "jitter", "a number from 0 to 1"),
        ({"layout": "jittered", "jitter": 1.1}, "jitter", "a number from 0 to 1"),
        ({"layout": "random", "spacing_m": 0}, "spacing_m", "a number from 0.001 to 10000000"),
        ({"layout": "random", "nodes": 0}, "nodes", "a whole number from 1 to 200000"),
        ({"layout": "ring", "radius_m": 0}, "radius_m", "a number from 0.001 to 10000000"),
        ({"layout": "ring", "radius_m": 1e8}, "radius_m", "a number from 0.001 to 10000000"),
        ({"layout": "ring", "nodes": 0}, "nodes", "a whole number from 1 to 200000"),
        ({"layout": "file", "file": ""}, "file", "a text"),
        ({"layout": "file", "file": 3}, "file", "a text"),
    ],
)
def test_a_layout_out_of_range(field: dict[str, Any], key: str, expected: str) -> None:
    message = failure({**LEAST, "field": field})
    assert message.startswith(f"field.{key}: is ")
    assert f"; expected {expected}" in message


@pytest.mark.parametrize(
    ("section", "value", "message"),
    [
        ("field", {"layout": "file"}, "field.file: missing; expected a text"),
        (
            "field",
            {"layout": "ring", "raduis_m": 5},
            "field.raduis_m: unknown; did you mean radius_m?; expected one",
        ),
        ("field", {"layout": "ring", "jitter": 0.1}, "field.jitter: belongs to layout jittered, not to ring"),
        ("field", {"layout": "rnadom"}, "field.layout: unknown layout 'rnadom'; did you mean random?; expected one of"),
        ("sensor", {"position_error": 5}, "sensor.position_error: unknown; did you mean position_error_m?"),
        ("lnik", {}, "lnik: unknown; did you mean link?; expected one of name, seed, restart, radio, field"),
        (
            "sensor",
            {"alhpa": 2.0},
            "sensor.alhpa: unknown; did you mean alpha?; expected one of kind, nodes, share, recording, play,",
        ),
        (
            "sensor",
            {"zzz": 2.0},
            "sensor.zzz: unknown; expected one of kind, nodes, share, recording, play, position_error_m, level_db,",
        ),
        ("sensor", 3, "sensor: is 3; expected a section [sensor]"),
        (
            "link",
            {"model": "fxed"},
            "link.model: unknown model 'fxed'; did you mean fixed?; expected one of ideal, fixed,",
        ),
        ("link", {"loss": 0.1}, "link.model: missing; expected one of ideal, fixed, gilbert_elliott"),
        ("link", {"model": "ideal", "loss": 0.1}, "link.loss: belongs to model fixed, not to ideal"),
        (
            "link",
            {"model": "lognormal", "ack": 1},
            "link.model: unknown model 'lognormal'; did you mean lognormal_prr?",
        ),
        ("link", {"model": "lognormal_prr", "raido": "wifi11b"}, "link.raido: unknown; did you mean radio?"),
        ("link", {"model": "trace"}, "link.file: missing; expected a text"),
        ("link", {"model": "fixed", "los": 0.1}, "link.los: unknown; did you mean loss?; expected one of"),
        ("field", {"layout": "gird"}, "field.layout: unknown layout 'gird'; did you mean grid?; expected"),
        ("target", 3, "target: is 3; expected a section [target]"),
        ("target", {}, "target.path: missing; expected one of s1, s2, s3, file, waypoints"),
        ("target", {"path": "waypoint"}, "target.path: unknown path 'waypoint'; did you mean waypoints?"),
        ("target", {"path": ["s1"]}, "target.path: unknown path"),
        ("target", {"path": "file"}, "target.file: missing; expected a text"),
        ("target", {"path": "file", "file": ""}, 'target.file: is ""; expected a text'),
        ("target", {"path": "file", "file": "a.gpx", "to": True}, "target.to: is true; expected HH:MM[:SS]"),
        ("name", "a b", 'name: is "a b"; expected up to 100 letters, digits'),
        ("name", "../up", 'name: is "../up"; expected up to 100 letters, digits'),
        ("seed", -1, "seed: is -1; expected a whole number from 0 to 9223372036854775807"),
        (
            "fusion",
            {"trackers": ["a", "a"]},
            "fusion.trackers: 'a' is given twice; expected each tracker once",
        ),
        (
            "fusion",
            {"deadline_s": 1.5},
            "fusion.deadline_s: is 1.5; expected at most target.step_s, which is 1",
        ),
    ],
)
def test_what_is_unknown_or_missing_is_told_with_what_would_be_right(section: str, value: Any, message: str) -> None:
    assert failure({**LEAST, section: value}).startswith(message)


@pytest.mark.parametrize(
    ("waypoints", "message"),
    [
        ([[0, 0, 0]], "is [[0, 0, 0]]; expected a list of at least two [t_s, x_m, y_m]"),
        ([[0, 0], [1, 1]], "is [0, 0]; expected a list of at least two [t_s, x_m, y_m]"),
        ([[0, 0, 0], [1, 1, "1"]], 'is "1"; expected a list of at least two [t_s, x_m, y_m]'),
        ([[-1, 0, 0], [1, 1, 1]], "is -1; expected a list of at least two [t_s, x_m, y_m]"),
        ([[0, 0, 0], [0, 1, 1]], "its times do not increase (0 s follows 0 s); expected increasing times"),
    ],
)
def test_waypoints_that_are_none(waypoints: list[list[Any]], message: str) -> None:
    found = failure({**LEAST, "target": {"path": "waypoints", "waypoints": waypoints}})
    assert found.startswith(f"target.waypoints: {message}")
    assert len(found.splitlines()) == 1


def test_name_and_target_are_missed() -> None:
    assert failure({}).splitlines() == [
        "name: missing; expected up to 100 letters, digits, and _ . - between them",
        "target: missing; expected a section [target], or sections [[targets]]",
    ]


def test_trackers_are_checked_where_they_are_known() -> None:
    given = {**LEAST, "fusion": {"trackers": ["spcf"]}}
    assert Scenario.load(given).fusion.trackers == ("spcf",)
    message = failure(given, known_trackers=["spcpf", "imm-ukf"])
    assert message == "fusion.trackers: unknown tracker 'spcf'; did you mean spcpf?; expected one of imm-ukf, spcpf"
    assert Scenario.load("spcpf", known_trackers={"spcpf": 1, "imm-ukf": 2}).name == "zhai-spcpf"


def test_all_errors_come_at_once_with_file_and_line(tmp_path: Path) -> None:
    text = """# a comment: alpha = 9
name = "mine"

[target]
path = "s1"
stpes = 3

[sensor]
threshold = "a"   # wrong
 "alpha" = 0

[link]
model = "fixed"
loss = 1
delay_ms = 0.1

[lnik]
"""
    file = write(tmp_path / "mine.toml", text)
    assert sorted(failure(file).splitlines()) == [
        f"{file}:10: sensor.alpha: is 0; expected a number from 0.5 to 20",
        f"{file}:15: link.delay_ms: is 0.1; expected a number from 1 to 3600000",
        f"{file}:17: lnik: unknown; did you mean link?; "
        "expected one of name, seed, restart, radio, field, sensor, sensors, target, targets, link, backbone, serial, "
        "architecture, camera, fusion, clock, energy, run, score, faults",
        f"{file}:6: target.stpes: unknown; did you mean steps?; expected one of path, id, step_s, steps, sound",
        f'{file}:9: sensor.threshold: is "a"; expected a number from 0 to 1, or "adaptive"',
    ]


def test_one_error_names_its_parts(tmp_path: Path) -> None:
    file = write(tmp_path / "mine.toml", 'name = "mine"\ntarget.path = "s1"\nsensor = {alpha = 0}\n')
    with pytest.raises(ScenarioError) as caught:
        Scenario.load(file)
    error = caught.value
    assert (error.file, error.key, error.expected) == (str(file), "sensor.alpha", "a number from 0.5 to 20")


def test_what_was_set_by_hand_is_not_blamed_on_the_file() -> None:
    message = 'sensor.threshold: is 5; expected a number from 0 to 1, or "adaptive"'
    assert failure("spcpf", {"sensor.threshold": 5}) == message
    assert failure("spcpf", {"lnik.model": "ideal"}).startswith("lnik: unknown; did you mean link?")
    assert failure("spcpf", {"sensor": {"alpha": 0}}).startswith("sensor.alpha: is 0")


def test_an_unknown_scenario_brings_the_nearest_name() -> None:
    expected = (
        "expected one of bus, hall, ozfidan-clusters, radar, yang-ecpa, yu-mrbpf, zhai-spcpf, zhou-upf, or a TOML file"
    )
    assert failure("zhai-spcfp") == f"unknown scenario 'zhai-spcfp'; did you mean zhai-spcpf?; {expected}"
    assert failure("zzzzz") == f"unknown scenario 'zzzzz'; {expected}"


def test_a_former_name_loads_and_is_told_to_nobody() -> None:
    for alias, name in ALIASES.items():
        assert Scenario.load(alias) == Scenario.load(name)
        assert alias not in names()


def test_files_that_cannot_be_read(tmp_path: Path) -> None:
    assert failure(tmp_path / "none.toml") == f"{tmp_path / 'none.toml'}: cannot be read (No such file or directory)"
    assert failure(str(tmp_path / "none.toml")).endswith("cannot be read (No such file or directory)")
    assert failure(str(tmp_path)).endswith("cannot be read (Is a directory)")
    assert "not a TOML file (Invalid value" in failure(write(tmp_path / "a.toml", "name ="))
    (tmp_path / "b.toml").write_bytes(b"\xff\xfe")
    assert "not a TOML file" in failure(tmp_path / "b.toml")


def test_layouts_have_their_own_keys() -> None:
    field = Scenario.load({**LEAST, "field": {"layout": "along-path", "within_m": 80.0}}).field
    assert isinstance(field, AlongPath)
    assert field.within_m == 80.0
    assert failure({**LEAST, "field": {"layout": "grid", "within_m": 80.0}}).startswith(
        "field.within_m: belongs to layout along-path or cells, not to grid"
    )
