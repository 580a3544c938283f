"""Curves break where nothing is known, plots leave room for their legends, and an outage is to be seen."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from launcher.records import FieldInfo, Place
from launcher.timeline import rows
from launcher.timeline.curves import PLOT, Axis, Curves
from tests.reporting import run
from tests.rrd import Values, read, views
from trackfield.role import NS

INFO = FieldInfo("r", "s", (Place("n", "node", 0.0, 0.0),), (), ("one",), 100.0)
LEFT, RIGHT = 1, 2


class Kept(list[tuple[float, tuple[float, ...]]]):
    """The rows of curves."""

    def add(self, path: str, columns: object, t_ns: int, values: tuple[float, ...]) -> None:
        assert columns is rows.scalars and path.startswith("/plots/error")
        self.append((t_ns / NS, values))


def drawn(values: dict[float, float]) -> tuple[Curves, Kept]:
    kept = Kept()
    curves = Curves(INFO, kept.add)
    for t, value in values.items():
        curves.value(("error", "one"), round(t * NS), (value,), NS)
    return curves, kept


def broken(values: Values) -> list[float]:
    """When a curve ends though it begins again."""
    return [t for t, value in values if t is not None and math.isnan(value[0])]


def test_a_curve_breaks_one_and_a_half_intervals_after_its_last_value() -> None:
    _, kept = drawn({1: 1.0, 2: 1.0, 3.4: 1.0, 9: 2.0, 10: 2.0})
    assert [t for t, (value,) in kept if math.isnan(value)] == [4.9]
    assert [t for t, (value,) in kept if not math.isnan(value)] == [1, 2, 3.4, 9, 10]


def test_of_many_curves_the_legend_is_left_out() -> None:
    curves, _ = drawn(dict.fromkeys(range(100), 10.0))
    assert curves.axis("error", ["a", "b", "c", "d", "e", "f"]) == Axis(10.5, legend=False)


@pytest.mark.parametrize("peak", [5, 50, 95])
@pytest.mark.parametrize("labels", [["lost", "late"], ["bound", "imm-ukf", "spcpf"]])
def test_no_curve_is_behind_the_legend(peak: int, labels: list[str]) -> None:
    curves, _ = drawn({t: 10.0 if abs(t - peak) < 4 else 2.0 for t in range(100)})
    axis = curves.axis("error", labels)
    assert axis is not None and axis.left == (peak > 80) and 10 < axis.top < 12
    wide, high = (45 + 5.5 * max(map(len, labels))) / PLOT[0], (14 + 22 * len(labels)) / PLOT[1]
    beside = range(int(100 * wide)) if axis.left else range(int(100 * (1 - wide)), 100)
    assert all((10.0 if abs(t - peak) < 4 else 2.0) <= axis.top * (1 - high) for t in beside)


def test_a_plot_full_of_high_curves_is_higher_by_its_legend() -> None:
    curves, _ = drawn(dict.fromkeys(range(100), 10.0))
    axis = curves.axis("error", ["one"])
    assert axis is not None and axis.top == pytest.approx(10 / (1 - 36 / PLOT[1]))
    nothing, _ = drawn(dict.fromkeys(range(100), 0.0))
    axis = nothing.axis("error", ["one"])
    assert axis is not None and axis.top == 1.0
    assert nothing.axis("latency", ["one"]) is None


# --- the centre dies at 5 s and is back at 12 s --------------------------------------------------------------


@pytest.fixture(scope="module")
def outage(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The timeline of a run, from the command line."""
    faults = "{kind='restart',nodes=['fusion'],at_s=5,until_s=12},{kind='clock_jump',nodes=['n001'],at_s=3,jump_ms=9}"
    folder = run(
        tmp_path_factory.mktemp("run") / "outage",
        f"faults=[{faults}]",
        scenario="zhai-spcpf",
        steps=20,
    )
    return folder / "run.rrd"


def test_curves_break_in_an_outage(outage: Path) -> None:
    for plot in ("error/imm-ukf", "error/spcpf", "error/bound", "latency"):
        values = read(outage, f"/plots/{plot}", "Scalars:scalars")
        (end,) = [t for t in broken(values) if 5 <= t <= 7]
        times = [t for t, _ in values if t is not None]
        assert not [t for t in times if end < t < 10.9], plot
        assert max(times) > 15


def test_lines_break_and_nothing_is_current_in_an_outage(outage: Path) -> None:
    for tracker in ("imm-ukf", "spcpf"):
        for name, component in (("position", "Points2D:positions"), ("ellipse", "LineStrips2D:strips")):
            rows = [(t, value) for t, value in read(outage, f"/field/{tracker}/{name}", component) if t is not None]
            assert [t for t, value in rows if 4 < t < 12.5 and not value] == [5.0], tracker
            assert not [t for t, value in rows if 5 <= t < 12 and value], tracker
            assert [t for t, value in rows if value][-1] > 15
        track = [value for t, value in read(outage, f"/field/{tracker}/track", "LineStrips2D:strips") if t is not None]
        assert len(track) > 5
        assert max(math.dist(*strip) for value in track for strip in value) < 60  # of a target at 10 m/s
    clouds = read(outage, "/field/spcpf/particles", "Points2D:positions")
    assert {len(value) for t, value in clouds if t is not None and 5 <= t < 12} == {0}


def test_a_fault_that_lasts_is_a_span_and_a_jump_an_instant(outage: Path) -> None:
    lane = read(outage, "/faults", "StateChange:state")
    assert [(t, value[0]) for t, value in lane] == [
        (3.0, "n001: clock jump by +9 ms"),
        (3.25, ""),
        (5.0, "fusion: killed and 1 more"),
        (5.25, "fusion: restart until 12 s"),
        (12.0, ""),
    ]
    texts = [value[0] for _, value in read(outage, "/faults", "TextLog:text")]
    assert "fusion: up again" in texts and "fusion: restart until 12 s" in texts


def test_plots_begin_at_0_and_their_legends_have_a_corner(outage: Path) -> None:
    shown = views(outage)
    for name in ("Error [m]", "Latency [ms]", "Frames lost", "Frames waiting", "Bytes/s"):
        (low, high), corner = shown[name]["ScalarAxis:range"][0], shown[name]["PlotLegend:corner"]
        assert -0.05 * high < low <= 0 < high, name
        assert corner in ([LEFT], [RIGHT]), name
    lost = read(outage, "/plots/lost", "Scalars:scalars")[-1][1][0]
    assert lost > 20 and lost < shown["Frames lost"]["ScalarAxis:range"][0][1]


def test_rays_are_there_on_the_whole_second(outage: Path) -> None:
    """Reports of a step take some milliseconds, and are drawn at the step that they are about, as the estimates are."""
    rays = [(t, value) for t, value in read(outage, "/field/rays", "LineStrips2D:strips") if t is not None]
    for second in (*range(2, 5), *range(13, 19)):
        *_, (since, shown) = [(t, value) for t, value in rays if t <= second]
        assert since == second and len(shown) >= 3


def test_links_show_the_frames_of_the_step(outage: Path) -> None:
    frames = {t: value for t, value in read(outage, "/links/frames", "LineStrips2D:strips") if t is not None}
    assert len(frames[3.0]) >= 3
    lost = {t: value for t, value in read(outage, "/links/lost", "Points2D:positions") if t is not None}
    assert len(lost[8.0]) >= 3 and not frames.get(8.0)
