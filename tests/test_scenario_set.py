"""Changing a scenario key by key, writing it, and reading it back."""

import tomllib
from datetime import time
from pathlib import Path
from typing import Any

import pytest

from trackfield.errors import ScenarioError
from trackfield.scenario import Scenario, names
from trackfield.scenario.override import parse


@pytest.mark.parametrize(
    ("text", "key", "value"),
    [
        ("link.model=fixed", "link.model", "fixed"),
        ("sensor.doa_sd_deg=.3", "sensor.doa_sd_deg", 0.3),
        ("sensor.doa_sd_deg=3", "sensor.doa_sd_deg", 3),
        ("sensor.doa_sd_deg=3e1", "sensor.doa_sd_deg", 30.0),
        (" seed = 7 ", "seed", 7),
        ('name="a=b"', "name", "a=b"),
        ("name=a=b", "name", "a=b"),
        ("fusion.trackers=['a', 'b']", "fusion.trackers", ["a", "b"]),
        ("faults=[{kind='kill', at_s=20}]", "faults", [{"kind": "kill", "at_s": 20}]),
        ("target.from=07:50:00", "target.from", time(7, 50)),
        ("target.from=07:50", "target.from", "07:50"),
        ("target.file=C:\\rides\\a.gpx", "target.file", "C:\\rides\\a.gpx"),
        ("x=true", "x", True),
        ("x=", "x", ""),
    ],
)
def test_a_setting_is_a_toml_value_or_bare_text(text: str, key: str, value: Any) -> None:
    found = parse(text)
    assert found == (key, value)
    assert type(found[1]) is type(value)


@pytest.mark.parametrize("text", ["link.model", "=3", "", " = "])
def test_what_sets_nothing(text: str) -> None:
    with pytest.raises(ScenarioError, match="sets nothing; expected key=value"):
        parse(text)


def test_setting_gives_another_scenario_and_leaves_the_first() -> None:
    first = Scenario.load("spcpf")
    other = first.set("sensor.doa_sd_deg", 30.0)
    assert (first.sensor.doa_sd_deg, other.sensor.doa_sd_deg) == (3.0, 30.0)
    assert other.set("sensor.doa_sd_deg", 3.0) == first
    assert first.set("seed", 9).seed == 9


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("sensor.doa_sd", 3, "sensor.doa_sd: unknown; did you mean doa_sd_deg?"),
        ("snsor.alpha", 3, "snsor: unknown; did you mean sensor?"),
        ("sensor.alpha.x", 3, "sensor.alpha: is 2.0; expected a section"),
        ("name.x", 3, "name: is 'zhai-spcpf'; expected a section"),
        ("sensor.alpha", "steep", 'sensor.alpha: is "steep"; expected a number from 0.5 to 20'),
        ("link.model", "gilbert", "link.model: unknown model 'gilbert'; did you mean gilbert_elliott?"),
        ("link.model", ["fixed"], "link.model: unknown model"),
        ("link", "fixed", 'link: is "fixed"; expected a section [link]'),
        ("link.delay_ms", 5, "link.delay_ms: belongs to model fixed or gilbert_elliott or ethernet, not to lognorm"),
        (
            "faults.kind",
            "kill",
            "faults: are a list, which can only be set as a whole; expected faults=[{kind='...', ...}, ...]",
        ),
    ],
)
def test_setting_what_is_wrong(key: str, value: Any, message: str) -> None:
    with pytest.raises(ScenarioError) as caught:
        Scenario.load("spcpf").set(key, value)
    assert str(caught.value).startswith(message)


def test_a_link_of_another_model_keeps_what_both_models_know() -> None:
    bus = Scenario.load("bus").set("link.range_m", 300.0)
    assert bus.set("link.model", "fixed").plain()["link"] == {
        "model": "fixed",
        "loss": 0.05,
        "delay_ms": 20.0,
        "range_m": 300.0,
    }
    assert bus.set("link.model", "ideal").plain()["link"] == {"model": "ideal", "range_m": 300.0}
    assert bus.set("link.model", "gilbert_elliott") == bus


def test_naming_a_key_of_one_model_chooses_the_model() -> None:
    spcpf = Scenario.load("spcpf")
    assert spcpf.set("link.loss", 1).plain()["link"] == {"model": "fixed", "loss": 1.0, "delay_ms": 5.0}
    assert spcpf.set("link.bad_s", 9).plain()["link"]["model"] == "gilbert_elliott"
    assert spcpf.set("link.radio", "wifi11b").plain()["link"]["model"] == "lognormal_prr"
    trace = spcpf.set("link.file", "/a.csv").plain()["link"]
    assert (trace["model"], trace["file"], trace["ack"]) == ("trace", "/a.csv", spcpf.plain()["link"]["ack"])
    assert "radio" not in trace
    with pytest.raises(ScenarioError, match=r"^field.within_m: belongs to layout along-path or cells, not to grid"):
        spcpf.set("field.within_m", 80)
    assert spcpf.set("field.jitter", 0.1).plain()["field"] == {
        "layout": "jittered",
        "jitter": 0.1,
        "spacing_m": 50.0,
        "extent_m": 500.0,
    }
    assert spcpf.set("field.radius_m", 80).plain()["field"] == {"layout": "ring", "radius_m": 80.0, "nodes": 30}
    assert spcpf.set("field.file", "/a.csv").plain()["field"] == {"layout": "file", "file": "/a.csv"}
    assert spcpf.set("target.file", "a.gpx").target.path == "file"
    assert Scenario.load("bus").set("link.loss_good", 0.1).plain()["link"]["bad_s"] == 4.0


def test_a_section_that_was_left_out_is_of_its_default_kind() -> None:
    least = {"name": "mine", "target": {"path": "s1"}}
    assert Scenario.load(least, {"link.range_m": 80}).plain()["link"] == {"model": "ideal", "range_m": 80.0}
    assert Scenario.load(least, {"field.extent_m": 100}).plain()["field"]["layout"] == "grid"


def test_several_settings_work_together_whatever_their_order() -> None:
    expected = {"model": "fixed", "loss": 0.5, "delay_ms": 3.0}
    settings = {"link.delay_ms": 3, "link.loss": 0.5}
    for values in (settings, dict(reversed(settings.items())), {**settings, "link.model": "fixed"}):
        assert Scenario.load("spcpf", values).plain()["link"] == expected
    assert Scenario.load("spcpf", {"link": {"model": "fixed", "loss": 0.5}}).plain()["link"]["delay_ms"] == 5.0


def test_loading_with_settings_is_loading_and_then_setting() -> None:
    for key, value in (("link.model", "fixed"), ("field.nodes", 50), ("target.steps", 5), ("seed", 3)):
        assert Scenario.load("bus", {key: value}) == Scenario.load("bus").set(key, value)


def test_all_wrong_settings_are_told_at_once() -> None:
    with pytest.raises(ScenarioError) as caught:
        Scenario.load("spcpf", {"sensor.alpha": 0, "fusion.prior": "x", "seed": 1.5})
    assert len(str(caught.value).splitlines()) == 3


# --- writing -----------------------------------------------------------------------------------------------

CHANGES: list[dict[str, Any]] = [
    {},
    {"link.model": "gilbert_elliott", "link.range_m": 123.456},
    {"target.path": "waypoints", "target.waypoints": [[0, 0, 0], [0.1, 1e-7, -1e7]]},
    {"target.path": "file", "target.file": 'odd "name".gpx', "target.from": "07:50", "target.steps": 7},
    {"field.layout": "jittered", "field.jitter": 0.1, "sensor.position_error_m": 5},
    {"field.layout": "random", "field.spacing_m": 33.3},
    {"field.layout": "ring", "field.nodes": 12},
    {"field.layout": "file", "field.file": "odd 'name'.csv"},
    {"field.layout": "along-path", "field.nodes": 50, "fusion.x_m": -1.5, "fusion.y_m": 0},
    {"link": {"model": "csma154", "acks": {"doa": 4, "sync-reply": 0}, "queue": 3}, "sensor.threshold": "adaptive"},
    {
        "fusion.x_m": None,
        "fusion.y_m": None,
        "fusion.path": [[0, 0, 0], [60, 500, 1e-3]],
        "clock.drift_ppm": 20,
        "energy.battery_j": 1e5,
        "restart": "on-death",
    },
    {
        "faults": [
            {"kind": "kill", "nodes": ["n060", "fusion"], "at_s": 20},
            {"kind": "freeze", "share": 0.1, "at_s": 0, "until_s": 0.5},
            {"kind": "bias", "share": 1, "at_s": 3, "bias_db": -1.5},
            {"kind": "clock_jump", "nodes": ["n001"], "at_s": 3, "jump_ms": -1000},
        ]
    },
]


@pytest.mark.parametrize("name", names())
@pytest.mark.parametrize("changes", CHANGES, ids=range(len(CHANGES)))
def test_a_written_scenario_reads_back_the_same(tmp_path: Path, name: str, changes: dict[str, Any]) -> None:
    scenario = Scenario.load(name, changes)
    (tmp_path / "scenario.toml").write_text(scenario.to_toml())
    again = Scenario.load(tmp_path / "scenario.toml")
    assert again == scenario
    assert again.to_toml() == scenario.to_toml()


def test_a_written_scenario_says_everything_and_explains_it() -> None:
    scenario = Scenario.load({"name": "mine", "target": {"path": "s2"}})
    text = scenario.to_toml()
    assert tomllib.loads(text) == scenario.plain()
    for line in text.splitlines():
        assert not line or line.startswith("[") or "  # " in line


def test_the_plain_form_is_plain() -> None:
    def kinds(value: Any) -> set[type]:
        if isinstance(value, dict):
            return {dict}.union(*(kinds(item) for item in value.values()))
        if isinstance(value, list):
            return {list}.union(*map(kinds, value))
        return {type(value)}

    plain = Scenario.load("bus", CHANGES[2]).plain()
    assert kinds(plain) <= {dict, list, str, int, float, bool}
    assert Scenario.load(plain) == Scenario.load("bus", CHANGES[2])
