"""How readings of each kind are drawn in the field: rays, rings and discs."""

from __future__ import annotations

from dataclasses import replace
from math import log10
from pathlib import Path
from typing import Any, Final

import numpy as np
import pytest

from launcher.records import SENSES, FieldInfo, MessageRow, Place
from launcher.timeline import look
from launcher.timeline.layers import READINGS
from launcher.timeline.layers.discs import LARGEST
from launcher.timeline.scene import Sight, spacing
from launcher.timeline.timeline import Timeline
from tests.rangers import Distance
from tests.rrd import read
from tests.sensing import registered
from trackfield.role import NS
from trackfield.sensing.sensing import LAYERS

PLACES: Final = {"n1": (-100.0, 0.0), "n2": (100.0, 50.0)}
SIGHT: Final = Sight(PLACES, (), 50.0, 40.0)


def test_there_is_a_layer_for_each_that_a_kind_may_name() -> None:
    assert tuple(READINGS) == LAYERS


def test_a_ring_is_a_circle_around_its_sensor() -> None:
    found = READINGS["rings"].shapes({"n1": 30.0, "n2": 7.0}, SIGHT)
    assert found.shape == (2, 65, 2)
    for circle, place, radius in zip(found, PLACES.values(), (30.0, 7.0), strict=True):
        assert np.hypot(*(circle - place).T) == pytest.approx(radius)
        assert circle[0] == pytest.approx(circle[-1])
        assert np.hypot(*np.diff(circle, axis=0).T).max() < 0.1 * radius  # looks round
    assert np.ptp(READINGS["rings"].shapes({"n1": -0.5}, SIGHT), axis=1).max() == 0.0  # a distance below 0 is none


def test_a_disc_is_on_its_sensor_and_smaller_than_its_neighbours_distance() -> None:
    found = READINGS["discs"].shapes({"n2": 1.0, "n1": 0.25}, SIGHT)
    assert found[:, :2].tolist() == [[100.0, 50.0], [-100.0, 0.0]]
    assert found[:, 2] == pytest.approx([LARGEST * 40.0, LARGEST * 10.0])
    assert LARGEST < 1.0


def test_a_ray_ends_a_little_past_the_first_fix() -> None:
    (ray,) = READINGS["rays"].shapes({"n1": 90.0}, SIGHT._replace(fixes=[(-50.0, 0.0)]))
    assert ray.tolist() == [[-100.0, 0.0], [pytest.approx(-100.0 + 1.15 * 50.0 + 5.0), pytest.approx(0.0, abs=1e-9)]]


@pytest.mark.parametrize("layer", LAYERS)
def test_without_readings_nothing_is_drawn(layer: str) -> None:
    assert len(READINGS[layer].shapes({}, SIGHT)) == 0


# --- in a file --------------------------------------------------------------------------------------------------------


def field(**changes: Any) -> FieldInfo:
    senses = frozenset({SENSES})
    places = (*(Place(id, "node", *at, senses) for id, at in PLACES.items()), Place("fusion", "fusion", 0.0, 0.0))
    return replace(FieldInfo("small", "small", places, (), ("one",), 10.0), **changes)


def drawn(file: Path, info: FieldInfo, *rows: MessageRow) -> Path:
    timeline = Timeline(file, info)
    for row in rows:
        timeline.message(row)
    timeline.close()
    return file


def row(kind: str, src: str, second: float, value: float) -> MessageRow:
    sent = round(second * NS)
    return MessageRow(kind, src, "fusion", "field", sent, sent + NS // 100, "delivered", 11, values=(value,))


def test_a_distance_is_drawn_for_its_step(tmp_path: Path) -> None:
    info = field(layers={"n1": "rings"})
    file = drawn(tmp_path / "run.rrd", info, row("range", "n1", 2.0, 30.0), row("range", "n2", 2.0, 30.0))
    shown = read(file, "/field/rings", "LineStrips2D:strips")
    assert [(t, len(strips)) for t, strips in shown] == [(2.05, 1), (3.0, 0)]
    assert np.hypot(*(np.array(shown[0][1][0]) - PLACES["n1"]).T) == pytest.approx(30.0, rel=1e-5)
    assert read(file, "/field/rays", "LineStrips2D:strips") == []


def test_a_level_is_drawn_as_the_distance_that_its_kind_says(tmp_path: Path) -> None:
    options = {"kind": "rss", "options": {"shadow_sd_db": 0.001}}
    info = field(layers={"n2": "rings"}, sensing={"n2": options})
    file = drawn(tmp_path / "run.rrd", info, row("rss", "n2", 2.0, -40.0 - 30.0 * np.log10(25.0)))
    ((_, (ring,)), _) = read(file, "/field/rings", "LineStrips2D:strips")
    assert np.hypot(*(np.array(ring) - PLACES["n2"]).T) == pytest.approx(25.0, rel=1e-5)


class Odd(Distance):
    """A kind that can draw distances above 0 only."""

    def drawn(self, values: Any) -> float:
        return 10.0 * log10(values[0])


def test_what_a_users_kind_cannot_draw_is_left_out(tmp_path: Path) -> None:
    sensing = {id: {"kind": "odd", "options": {}} for id in PLACES}
    info = field(layers=dict.fromkeys(PLACES, "rings"), sensing=sensing)
    with registered(odd=Odd):
        file = drawn(
            tmp_path / "run.rrd", info, row("measurement", "n1", 2.0, -1.0), row("measurement", "n2", 2.0, 100.0)
        )
    ((_, (ring,)), _) = read(file, "/field/rings", "LineStrips2D:strips")
    assert np.hypot(*(np.array(ring) - PLACES["n2"]).T) == pytest.approx(20.0, rel=1e-5)


def test_energies_are_drawn_as_discs_in_metres(tmp_path: Path) -> None:
    sensing = {id: {"kind": "energy", "options": {}} for id in PLACES}
    info = field(layers=dict.fromkeys(PLACES, "discs"), sensing=sensing)
    file = drawn(tmp_path / "run.rrd", info, row("energy", "n1", 2.0, 1e9), row("energy", "n2", 3.0, 20.0))
    at = read(file, "/field/discs", "Points2D:positions")
    radii = read(file, "/field/discs", "Points2D:radii")
    assert at == [(2.05, [[-100.0, 0.0]]), (3.0, []), (3.05, [[100.0, 50.0]]), (4.0, [])]
    (_, (loud,)), _, (_, (faint,)), _ = radii
    assert 0.0 < faint < loud == pytest.approx(LARGEST * spacing(info), rel=1e-5)  # radii above 0 are in metres
    assert read(file, "/field/discs", "Points2D:colors") == [(None, [look.DISC])]
