"""What a user is told before a run that cannot go well, by ``validate`` and by ``run``; all else is silent."""

from __future__ import annotations

import json
import re
import shlex
from pathlib import Path

import numpy as np
import pytest

from launcher.plan.forecast.foresight import at_least, foresee
from launcher.plan.prepare import load, planned
from launcher.record.ledger import Ledger
from tests.command_line import Call, Said, trackfield
from tests.rangers import Distance, Ranger
from tests.simulated import simulated
from trackfield.sensing.complete import Kind

__all__ = ["trackfield"]

README = Path(__file__).parents[1] / "README.md"
LORA = ("--set", "link.radio=lora868", "--set", "link.sf=12")


def warnings(said: Said) -> list[str]:
    assert said.code == 0, said.err
    return [line.removeprefix("warning: ") for line in said.err.splitlines() if line.startswith("warning: ")]


def validated(trackfield: Call, *arguments: str) -> list[str]:
    """The warnings of a scenario, whose number is told, too."""
    said = trackfield("validate", *arguments)
    found = warnings(said)
    many = f"valid, with {len(found)} warning{'s' * (len(found) != 1)}" if found else "valid"
    assert said.err.splitlines()[-1] == many
    return found


# --- fields in which all is well --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "arguments",
    [
        *(
            ("zhai-spcpf", "--set", f"target.path={path}", "--seed", seed)
            for path in ("s1", "s2", "s3")
            for seed in "123"
        ),
        ("zhai-spcpf", "--link", "gilbert_elliott"),
        ("zhai-spcpf", "--set", "link.loss=0.2"),
        ("bus",),
        ("radar",),
    ],
)
def test_a_field_that_works_has_no_warnings(trackfield: Call, arguments: tuple[str, ...]) -> None:
    assert validated(trackfield, *arguments) == []


def test_what_the_readme_runs_has_no_warnings_and_loses_next_to_nothing(trackfield: Call) -> None:
    text = README.read_text().replace("\\\n", " ")
    lines = [line for line in text.splitlines() if "    trackfield run zhai-spcpf" in line]
    commands = [shlex.split(line, comments=True) for line in lines]
    assert len(commands) >= 6
    for _, _, *arguments in commands:
        options = [one for one in arguments if one not in ("--out", "a", "b", "--live")]
        assert validated(trackfield, *options) == [], arguments
    (showcase,) = [arguments for _, _, *arguments in commands if "--nodes" in arguments]
    assert trackfield("run", *showcase, "--virtual", "--quiet", "--out", "thousand").code == 0
    metrics = json.loads(Path("thousand", "metrics.json").read_text())
    assert metrics["processes"]["started"] > 950
    assert metrics["frames"]["delivered"] > 0.98 * metrics["frames"]["sent"]
    assert {one["verdict"] for one in metrics["trackers"].values()} == {"tracked"}


def test_a_node_that_never_reports_may_have_a_dead_link() -> None:
    """n044 of the paper's field is in a radio shadow, and no vehicle comes near it."""
    plan = planned(load("zhai-spcpf"))
    shares = {src: share for src, _, share in plan.info.receptions}
    assert shares["n044"] < 0.01
    assert "n044" not in foresee(plan).reports


# --- fields that cannot work ------------------------------------------------------------------------------------------


def test_reports_that_come_after_the_deadline(trackfield: Call) -> None:
    late, queue, channel, duty = validated(trackfield, "zhai-spcpf", *LORA)
    assert late == (
        "100% of the reports that arrive are too late (delay 9.19 s, 95% within 20.7 s; fusion.deadline_s is 300 ms), "
        "enough for a fix (2) in 0 of 60 steps; use a faster radio, a longer fusion.deadline_s, or "
        "fusion.max_age_s"
    )
    assert queue.startswith("a report takes its node's radio 2.64 s, and a step lasts 1 s: ")
    assert channel.startswith("the reports of a step take 10.6 s on air if none collide, and a step lasts 1 s: ")
    assert duty.startswith(
        "fusion sends acknowledgements for 278 s in an hour, and in the band of lora868 36 s are allowed"
    )
    found = validated(trackfield, "zhai-spcpf", *LORA, "--set", "fusion.max_age_s=5")
    assert found[0].startswith("80% of the reports that arrive are too late (")
    found = validated(trackfield, "zhai-spcpf", *LORA, "--set", "fusion.max_age_s=60")
    assert [line.partition(" ")[0] for line in found] == ["a", "the", "fusion"]  # late, but taken in after all


def test_reports_that_one_channel_cannot_carry_in_time(trackfield: Call) -> None:
    """Each would come in time, were it alone; the models leave collisions out."""
    (channel,) = validated(trackfield, "zhai-spcpf", "--set", "link.radio=lora868", "--set", "link.sf=7")
    assert (
        "take 434 ms on air if none collide, and fusion.deadline_s is 300 ms: one channel cannot carry them" in channel
    )


def test_a_target_that_leaves_the_field(trackfield: Call) -> None:
    assert validated(trackfield, "zhai-spcpf", "--nodes", "25") == [
        "the target is outside the field: no sensor is within 56 m of it in 29 of 60 steps (longest: 29 s "
        "from t = 32 s on), enough for a fix (2) in 26 of 60 steps"
    ]


def test_a_target_that_comes_from_outside(trackfield: Call) -> None:
    """It does not leave, and is there at the end."""
    gone, *_ = validated(trackfield, "zhai-spcpf", "--set", "target.waypoints=[[0,-600,0],[60,250,0]]")
    assert gone.startswith("the target is outside the field: no sensor is within 56 m of it in ")
    assert " from t = 1 s on" in gone


def test_a_field_with_gaps(trackfield: Call) -> None:
    path = "target.waypoints=[[0, 0, 0], [100, 200, 0]]"
    (gap,) = validated(trackfield, "zhai-spcpf", "--sensors", posts("0,0", "1,1", "199,1", "200,0"), "--set", path)
    assert gap.startswith("the field has gaps along the target's path: no sensor is within 56 m of it in ")
    (few,) = validated(trackfield, "zhai-spcpf", "--sensors", posts("0,0", "70,0", "140,0", "200,0"), "--set", path)
    assert few.startswith("too few sensors along the path: within 56 m of the target, enough for a fix (2) in ")


def posts(*places: str) -> str:
    rows = [f"p{i},{place}" for i, place in enumerate(places)]
    Path("posts.csv").write_text("\n".join(["id,x,y", *rows]))
    return "posts.csv"


def test_links_that_do_not_reach_and_a_run_that_says_so_first(trackfield: Call) -> None:
    """The forecast is what then happens: links in the shadow stay there."""
    (lost,) = validated(trackfield, "zhai-spcpf", "--nodes", "1000")
    assert lost == (
        "less than 50% of doa arrive on the links of 17 of the 25 sensor nodes that will report (worst: n167 to "
        "fusion, 0%); 66 of 241 reports may be expected to arrive, enough for a fix (2) in 15 of 60 steps"
    )
    said = trackfield("run", "zhai-spcpf", "--nodes", "1000", "--virtual", "--out", "mine")
    assert warnings(said) == [lost]
    assert said.err.index("warning: ") < said.err.index("tracker ")
    assert json.loads(Path("mine", "manifest.json").read_text())["warnings"] == [lost]
    frames = json.loads(Path("mine", "metrics.json").read_text())["frames"]
    assert (frames["sent"], frames["delivered"]) == (241, 66)


def test_a_link_that_loses_half(trackfield: Call) -> None:
    (weak,) = validated(trackfield, "zhai-spcpf", "--set", "link.loss=0.5")
    assert weak == "50% of all reports may be expected to arrive in time, enough for a fix (2) in 41 of 60 steps"


def test_the_reports_of_several_targets_are_counted_together(trackfield: Call) -> None:
    other = "targets=[{id='second', path='waypoints', waypoints=[[0, 0, 0], [60, 400, 0]]}]"
    found = validated(trackfield, "zhai-spcpf", "--set", other, "--set", "link.loss=0.5")
    whole = r"50% of all reports may be expected to arrive in time, enough for a fix \(2\) of (\w+) in \d+ of 60 steps"
    assert {match[1] for line in found if (match := re.fullmatch(whole, line))} == {"target", "second"}
    (lost,) = validated(trackfield, "zhai-spcpf", "--set", other, "--set", "link.loss=0.6")
    assert re.search(r" reports may be expected to arrive, enough for a fix \(2\) of (target|second) in \d+ of", lost)


@pytest.mark.parametrize("arguments", [["--nodes", "25"], ["--set", "link.loss=0.5"], ["--set", "link.loss=0.6"]])
def test_figures_of_some_of_the_steps_are_about_right(
    trackfield: Call, monkeypatch: pytest.MonkeyPatch, arguments: list[str]
) -> None:
    """Of a run of very many reports, not all steps are looked at."""
    (exact,) = validated(trackfield, "zhai-spcpf", *arguments)
    monkeypatch.setattr("launcher.plan.forecast.heard.MOST_REPORTS", 80)
    (about,) = validated(trackfield, "zhai-spcpf", *arguments)
    counts = re.compile(r"(about )?(\d+) of (\d+) (?:steps|reports)")
    assert {said for said, *_ in counts.findall(exact)} == {""}
    assert {said for said, *_ in counts.findall(about)} == {"about "}
    for (_, n, _), (_, m, _) in zip(counts.findall(exact), counts.findall(about), strict=True):
        assert int(m) == pytest.approx(int(n), rel=0.15)


def test_several_targets_are_told_apart(trackfield: Call) -> None:
    away = "targets=[{id='far', path='waypoints', waypoints=[[0, 400, 400], [60, 4000, 400]]}]"
    (gone,) = validated(trackfield, "zhai-spcpf", "--set", away)
    assert gone.startswith("the target far is outside the field: ")


def test_sensors_of_a_users_own_say_how_many_a_fix_takes() -> None:
    class Circles(Distance):
        fix_sensors = 3

    assert [Kind("own", sensor()).fix_sensors for sensor in (Ranger, Distance, Circles)] == [1, 2, 3]


# --- the figures ------------------------------------------------------------------------------------------------------


def test_the_reports_foreseen_are_those_that_are_sent() -> None:
    plan = planned(load("bus", settings=["sensor.level_sd_db=0", "clock.offset_ms=0", "clock.drift_ppm=0"]))
    ledger, _ = simulated(plan)
    assert isinstance(ledger, Ledger)
    sent: dict[str, int] = {}
    for row in ledger.rows:
        if row.kind == "doa":
            sent[row.src] = sent.get(row.src, 0) + 1
    assert foresee(plan).reports == sent


def test_so_many_of_several() -> None:
    chances = np.array([[0.5, 0.5, 0.5], [1.0, 0.2, 0.0], [0.0, 0.0, 0.0]])
    assert at_least(1, chances).tolist() == pytest.approx([7 / 8, 1.0, 0.0])
    assert at_least(2, chances).tolist() == pytest.approx([4 / 8, 0.2, 0.0])
    assert at_least(3, chances).tolist() == pytest.approx([1 / 8, 0.0, 0.0])


# --- all that is wrong, at once ---------------------------------------------------------------------------------------


def test_all_that_is_wrong_is_told_at_once(trackfield: Call, tmp_path: Path) -> None:
    (tmp_path / "mine.toml").write_text('name = "mine"\n\n[target]\npath = "s1"\n\n[sensor]\nalpha = "two"\n')
    options = ("--set", "link.acks={daa=3}", "--set", "link.model=csma154", "--tracker", "nope", "--from", "7:50")
    said = trackfield("validate", "mine.toml", *options, "--virtual", "--speed", "5", "--connect", "x")
    assert (said.code, said.out) == (2, "")
    assert sorted(line.partition(";")[0] for line in said.err.removeprefix("trackfield: ").splitlines()) == [
        "--connect: a run in virtual time uses no router",
        "--connect: is 'x'",
        "--from, --to: there is no track to cut",
        "--speed: virtual time goes as fast as the machine can",
        "fusion.trackers: unknown tracker 'nope'",
        "link.acks: there is no message 'daa'",
        'mine.toml:7: sensor.alpha: is "two"',
    ]
    assert [file.name for file in tmp_path.iterdir()] == ["mine.toml"]


def test_what_shows_as_a_field_is_laid_out_is_told_at_once_too(trackfield: Call, tmp_path: Path) -> None:
    (tmp_path / "posts.csv").write_text("id,x,y\na,1,here\nb,there,2\n")
    faults = "faults=[{kind='kill', nodes=['a'], at_s=99}, {kind='deaf', nodes=['c'], at_s=1}]"
    said = trackfield("validate", "zhai-spcpf", "--sensors", "posts.csv", "--set", "link.file=no.csv", "--set", faults)
    assert said.code == 2
    found = said.err.splitlines()
    parts = [part for line in found for part in re.findall(r"posts.csv:\d: . is '\w+'|no.csv: cannot be read", line)]
    assert sorted(parts) == ["no.csv: cannot be read", "posts.csv:2: y is 'here'", "posts.csv:3: x is 'there'"]
    said = trackfield("validate", "zhai-spcpf", "--set", faults)
    assert [line.partition(";")[0] for line in said.err.removeprefix("trackfield: ").splitlines()] == [
        "faults[0].at_s: is 99, and the run ends at 61 s",
        "faults[1].nodes: there is no 'c'",
    ]


def test_a_script_gets_json(trackfield: Call) -> None:
    said = trackfield("validate", "zhai-spcpf", "--nodes", "25", "--json", "--quiet")
    assert (said.code, said.err) == (0, "")
    found = json.loads(said.out)
    assert found["valid"] is True
    assert found["warnings"][0].startswith("the target is outside the field")
    assert found["summary"][0].startswith("coverage: ")
    said = trackfield("validate", "zhai-spcpf", "--set", "link.loss=2", "--set", "seed=-1", "--json")
    assert said.code == 2
    assert json.loads(said.out) == {"valid": False, "errors": said.err.removeprefix("trackfield: ").splitlines()}


# --- options that would have no effect --------------------------------------------------------------------------------


@pytest.mark.parametrize("command", ["run", "validate"])
@pytest.mark.parametrize(
    ("options", "parts"),
    [
        (["--virtual", "--speed", "5"], ["--speed: virtual time goes as fast as", "it without --virtual"]),
        (["--virtual", "--connect", "tcp/127.0.0.1:7447"], ["--connect: a run in virtual time uses no router"]),
        (["--virtual", "--live"], ["--live: a run in virtual time is over at once"]),
        (["--virtual", "--external"], ["--external: there are no processes in virtual time"]),
        (["--external"], ["--external: other processes cannot find the run's own router", "--connect as well"]),
        (["--seed", "3", "--set", "seed=4"], ["seed: is set twice", "either --set seed=... or --seed"]),
        (["--link", "ideal", "--set", "link.model=fixed"], ["link.model: is set twice", "--link"]),
        (["--tracker", "ekf", "--set", "fusion.trackers=['ukf']"], ["fusion.trackers: is set twice"]),
        (["--set", "link.loss=0.1", "--set", "link.loss=0.2"], ["link.loss: is set twice", "a single --set"]),
        (["--nodes", "25", "--set", "field.extent_m=90"], ["field.extent_m: has no effect", "field.nodes"]),
        (["--link", "ideal", "--set", "link.loss=0.1"], ["link.loss: belongs to model fixed, not to ideal"]),
        (["--from", "8:00"], ["--from, --to: there is no track to cut"]),
        (["--speed", "0"], ["--speed: is 0.0"]),
    ],
)  # fmt: skip
def test_an_option_without_effect_is_refused(
    trackfield: Call, tmp_path: Path, command: str, options: list[str], parts: list[str]
) -> None:
    said = trackfield(command, "zhai-spcpf", *options)
    assert (said.code, said.out) == (2, "")
    assert said.err.startswith("trackfield: ")
    for part in parts:
        assert part in said.err
    assert list(tmp_path.iterdir()) == []


def test_the_window_of_a_recorded_track_may_be_cut_without_naming_it(trackfield: Call) -> None:
    said = trackfield("validate", "bus", "--from", "08:00:30")
    assert said.err.startswith("bus: ")
    assert ", 72 s, " in said.err


def test_validate_looks_at_the_folder_too_and_leaves_it(trackfield: Call, tmp_path: Path) -> None:
    (tmp_path / "old").mkdir()
    (tmp_path / "old" / "notes.txt").write_text("mine")
    said = trackfield("validate", "zhai-spcpf", "--out", "old")
    assert said.code == 2
    assert "old: --out: the folder is not empty; expected an empty or new one" in said.err
    assert trackfield("validate", "zhai-spcpf", "--out", "new").code == 0
    assert [file.name for file in tmp_path.iterdir()] == ["old"]
