"""The scenarios that come with the package, the bus ride, and the documentation of all keys."""

import re
import tomllib
from itertools import pairwise
from math import hypot
from pathlib import Path

import numpy as np
import pytest
import soundfile

from launcher.plan.forecast.reception import receptions
from launcher.plan.prepare import planned
from trackfield.scenario import Scenario, names, summary, survey
from trackfield.scenario.document import BEGIN, END, tables, updated
from trackfield.scenario.keys import sections_of_file, top_level
from trackfield.scenario.make_bus import FILE, SPEED_UP, gpx, ride
from trackfield.scenario.packaged import or_packaged, packaged_file
from trackfield.scenario.sections.clocks import Clocks
from trackfield.scenario.sections.energy import Energy
from trackfield.scenario.sensors import OF_GROUPS
from trackfield.world.fixes import read_fixes

DOCUMENT = Path(__file__).parents[1] / "docs" / "scenarios.md"


def test_there_are_eight() -> None:
    assert names() == ("bus", "hall", "ozfidan-clusters", "radar", "yang-ecpa", "yu-mrbpf", "zhai-spcpf", "zhou-upf")
    for name in names():
        assert Scenario.load(name).name == name
        assert 20 < len(summary(name)) < 120
        assert not summary(name).startswith("#")


def test_zhai_spcpf_is_the_papers() -> None:
    scenario = Scenario.load("spcpf", known_trackers=["spcpf", "imm-ukf"])
    sensor = scenario.sensor
    assert (sensor.level_db, sensor.alpha, sensor.threshold, sensor.doa_sd_deg) == (70.0, 2.0, 0.75, 3.0)
    assert sensor.level_sd_db == 0.0
    assert scenario.fusion.trackers == ("imm-ukf", "spcpf")
    assert (scenario.fusion.prior, scenario.fusion.prior_sd) == ("paper", (20.0, 20.0, 4.0, 4.0))
    site = survey(scenario)
    assert (len(site.sensors), site.steps, site.step_ns, site.centre) == (121, 60, 10**9, (250.0, 250.0))
    assert survey(scenario.set("target.path", "s2")).steps == 75


def test_zhai_spcpf_has_a_radio_that_works_there_right_clocks_and_mains() -> None:
    scenario = Scenario.load("spcpf")
    assert (scenario.link.model, scenario.plain()["link"]["radio"]) == ("lognormal_prr", "802154-20dbm")
    assert scenario.clock == Clocks()
    assert scenario.energy == Energy()
    for seed in range(1, 21):
        shares = receptions(planned(scenario.set("seed", seed)))["doa"].values()
        assert sum(shares) / len(shares) > 0.975
        assert sum(share < 0.5 for share in shares) <= 3


def test_the_bus_has_clocks_that_are_off_and_batteries() -> None:
    scenario = Scenario.load("bus")
    assert (scenario.clock.offset_ms, scenario.clock.drift_ppm, scenario.clock.sync) == (50.0, 20.0, True)
    assert scenario.energy.battery_j == 20_000.0
    assert planned(scenario).processes[1].power["battery_fj"] == 20_000 * 10**15


def test_the_bus_meets_a_real_radio() -> None:
    link = Scenario.load("bus").plain()["link"]
    assert link["model"] == "gilbert_elliott"
    assert link["bad_s"] > 0
    assert link["delay_ms"] + link["jitter_ms"] >= 20
    assert Scenario.load("bus").fusion.prior == "none"


def test_the_bus_lets_the_demo_end_in_time() -> None:
    site = survey(Scenario.load("bus"))
    assert 80 <= site.steps <= 110
    assert 50 <= len(site.sensors) <= 121
    assert site.paths["target"].gaps == ()


def written(name: str) -> list[tuple[str, str, str]]:
    """(section, key, comment) of all lines of a packaged file that set something, or would if they were no comment."""
    section, found = "", []
    for line in packaged_file(name).read_text().splitlines():
        if header := re.fullmatch(r"(?:# )?\[+(\w+)\]+", line):
            section = header[1]
        elif setting := re.match(r"(?:# )?(\w+) = (?:\"[^\"]*\"|[^#\"])+(#.*)?$", line):
            found.append((section, setting[1], setting[2] or ""))
    return found


@pytest.mark.parametrize("name", names())
def test_every_key_of_its_kind_is_there_and_has_a_comment(name: str) -> None:
    lines = written(name)
    assert all(comment for _, _, comment in lines)
    plain, sections = Scenario.load(name).plain(), sections_of_file()
    for part, kinds in sections.items():
        if part not in plain and not kinds.many:  # of another medium
            continue
        found = {key for section, key, _ in lines if section == part}
        every = kinds.keys(None if kinds.many else plain[part].get(kinds.tag)).keys()
        if part == "sensor":
            every -= set(OF_GROUPS)
        assert found <= every if kinds.many else found == every
    assert {key for section, key, _ in lines if not section} == top_level().keys()
    assert {key for section, key, _ in lines if section == "faults"} >= {"kind", "nodes", "share", "at_s"}


def test_data_that_come_along_are_found_unless_there_is_a_file_of_that_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    packaged = packaged_file("hall").with_name("walk_05.csv")
    assert or_packaged(Path("walk_05.csv")) == packaged
    assert or_packaged(Path("none/walk_05.csv")) == Path("none/walk_05.csv")
    assert or_packaged(Path("hall.toml")) == Path("hall.toml")  # no data
    assert Scenario.load("hall", {"sensor.recording": "walk_05.csv"}) == Scenario.load("hall")
    Path("walk_05.csv").write_text("t_s,sensor,level\n")
    assert or_packaged(Path("walk_05.csv")) == Path("walk_05.csv")
    own = Scenario.load("hall", {"sensor.recording": "walk_05.csv"}).plain()["sensor"]["recording"]
    assert own == str(tmp_path / "walk_05.csv")


@pytest.mark.parametrize("name", names())
@pytest.mark.parametrize("drives", [True, False])
def test_the_keys_that_are_commented_out_are_right_too(name: str, drives: bool, tmp_path: Path) -> None:
    """All at once, but for those that go with another radio or field, or tell in another way where the centre is."""
    alone = "sf|recording|sound|x_m|y_m" if drives else r"sf|recording|sound|path = \[\[0,"
    text = re.sub(rf"^# (?!({alone}) )(\w+ = |\[\[)", r"\2", packaged_file(name).read_text(), flags=re.MULTILINE)
    text = text.replace('"bus.gpx"', f'"{FILE}"')
    if drives:
        text = re.sub(r"^([xy]_m = )", r"# \1", text, flags=re.MULTILINE)
    (tmp_path / "all.toml").write_text(text)
    scenario = Scenario.load(tmp_path / "all.toml")
    assert survey(scenario).steps == (100 if name == "yu-mrbpf" else 60)
    assert (scenario.fusion.path is not None) is drives
    assert len(planned(scenario).info.marks) >= 4


# --- the bus ride ------------------------------------------------------------------------------------------


def test_the_ride_is_what_its_script_makes() -> None:
    assert FILE.read_text() == gpx()


def test_a_fix_a_second() -> None:
    assert {b - a for a, b in pairwise(read_fixes(FILE).t.tolist())} == {1.0}


def test_the_bus_drives_like_a_bus() -> None:
    times, places = ride()
    speeds = [
        (hypot(bx - ax, by - ay) / (b - a), (a + b) / 2)
        for (a, b), ((ax, ay), (bx, by)) in zip(pairwise(times), pairwise(places), strict=True)
    ]
    assert 9.0 < max(speed for speed, _ in speeds) <= 13.0
    waits = [b - a for (a, b), (p, q) in zip(pairwise(times), pairwise(places), strict=True) if p == q]
    assert waits == pytest.approx([2.0, 6.0, 6.0, 3.0])
    accelerations = [(v - u) / (t - s) for (u, s), (v, t) in pairwise(speeds) if u > 0 and v > 0 and t > s]
    assert max(accelerations) == pytest.approx(SPEED_UP, abs=0.05)
    assert -1.5 <= min(accelerations) < -1.0


def test_the_bus_turns_around_three_corners() -> None:
    path = survey(Scenario.load("bus")).paths["target"]
    corners = 0
    for t in range(5, int(path.end_s) - 10):
        before, after = path.at(float(t)), path.at(float(t + 10))
        assert before is not None
        assert after is not None
        cross = before[2] * after[3] - before[3] * after[2]
        speeds = hypot(*before[2:]) * hypot(*after[2:])
        corners += speeds > 4.0 and abs(cross) > 0.9 * speeds
    assert corners >= 3


# --- documentation -----------------------------------------------------------------------------------------


def test_the_document_has_todays_keys() -> None:
    text = DOCUMENT.read_text()
    assert updated(text) == text, "run: python -m trackfield.scenario.document docs/scenarios.md"


def test_the_tables_have_every_key_with_unit_default_and_range() -> None:
    text = tables()
    for name, section in sections_of_file().items():
        assert f"### `{section.header(name)}`" in text
        for keys in section.kinds.values():
            assert all(f"| `{key}` |" in text for key in keys)
    assert '| `threshold` | doa |  | `0.75` | a number from 0 to 1, or "adaptive" |' in text
    assert "### `[[faults]]`" in text
    assert "| `jump_ms` | clock_jump | ms | required | a number from -1e9 to 1e9, but not 0 |" in text
    assert "| `delay_ms` | fixed | ms | `5.0` | a number from 1 to 3600000 |" in text
    assert "| `delay_ms` | gilbert_elliott | ms | `20.0` | a number from 1 to 3600000 |" in text
    assert "| `file` | file |  | required | a text |" in text
    assert all(key.meaning for section in sections_of_file().values() for key in section.keys(None).values())


def test_a_document_needs_its_marks() -> None:
    assert updated(f"a\n{BEGIN}\nold\n{END}\nb\n") == f"a\n{BEGIN}\n\n{tables()}\n\n{END}\nb\n"
    for text in ("", BEGIN, END, f"{END}{BEGIN}"):
        with pytest.raises(ValueError, match="needs the marks"):
            updated(text)


def test_what_the_document_writes_into_files_works(tmp_path: Path) -> None:
    parts = re.findall(r"```toml\n(.*?)```", DOCUMENT.read_text(), flags=re.DOTALL)
    crossing, external, drifting, targets, heard, sensors, score, faults, recorded, radios = parts
    (tmp_path / "crossing.toml").write_text(crossing)
    assert survey(Scenario.load(tmp_path / "crossing.toml")).steps == 45
    assert planned(Scenario.load("zhai-spcpf", tomllib.loads(external))).external == ("n007",)
    wide = survey(
        Scenario.load({"name": "mine", "sensor": {"kind": "range", "range_m": 22_627}} | tomllib.loads(drifting))
    )
    assert (len(wide.sensors), wide.steps, wide.paths["target"].x[0]) == (256, 1000, 8000.0)
    several = Scenario.load({"name": "mine"} | tomllib.loads(targets))
    assert [target.id for target in several.every_target] == ["target", "truck"]
    (tmp_path / "microphones.csv").write_text("id,x,y\na,0,0\nb,20,0\n")
    soundfile.write(tmp_path / "field.wav", np.zeros((4 * 8000, 2)), 8000)
    (tmp_path / "heard.toml").write_text('name = "mine"\n' + heard)
    assert survey(Scenario.load(tmp_path / "heard.toml")).steps == 8
    mixed = survey(Scenario.load("zhai-spcpf", tomllib.loads(sensors)))
    assert {name: len(members) for name, members in mixed.kinds.items()} == {"doa": 61, "doa-2": 60}
    lost = Scenario.load("zhai-spcpf", tomllib.loads(score)).score.lost
    assert (lost.beyond_m, lost.steps, lost.within) == (30.0, 5, 20)
    faulty = planned(Scenario.load("zhai-spcpf", tomllib.loads(faults)))
    assert [p.name for p in faulty.processes if p.incarnation] == ["fusion~1", "n060~1"]
    assert sum(bool(p.faults) for p in faulty.processes) == 12 + any(
        p.faults for p in faulty.processes if p.incarnation
    )
    (tmp_path / "sensors.csv").write_text("id,x,y\na,0,0\n")
    (tmp_path / "reports.csv").write_text("t_s,sensor,level\n3,a,-70\n4.25,a,-71\n")
    (tmp_path / "recorded.toml").write_text('name = "mine"\n' + recorded)
    assert survey(Scenario.load(tmp_path / "recorded.toml", {"fusion.deadline_s": 0.2})).steps == 3
    own = planned(Scenario.load("zhai-spcpf", tomllib.loads(radios)))
    assert {p.tx_dbms[p.id] for p in own.processes} == {-5.0, 0.0}
