"""A hostile peer at the router of a secured run: nobody comes in without a certificate, and with one only what is its
own.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.hostile.attack import Attack
from tests.hostile.frames import inbox, report, stamp
from tests.hostile.mixes import HARMLESS, OTHERS
from tests.hostile.papers import THIEF, Shown
from tests.hostile.samples import ALARM, ALL, Bad, Make, Means, Sample
from tests.hostile.secured import Secured, attacked
from tests.hostile.tellings import event, plausible
from trackfield.drivers.exchange.telemetry import pack
from trackfield.wire import keys

FLOOD = 2000.0
EVERYTHING = Attack((*HARMLESS, *OTHERS), seed=1, rate=200.0)


def interference(found: Secured) -> dict[str, int]:
    assert found.wrong == []
    assert found.run is not None
    assert found.run.code == 1
    return {kind: n for kind, n in found.run.metrics["interference"].items() if n}


@pytest.mark.parametrize(
    "shown",
    [
        Shown.NONE,
        pytest.param(Shown.FORGED, marks=pytest.mark.long),
        Shown.EXPIRED,
        pytest.param(Shown.ANOTHER_RUNS, marks=pytest.mark.long),
    ],
    ids=lambda shown: shown.name,
)
def test_nobody_comes_in_without_a_certificate_of_the_run(shown: Shown, tmp_path: Path) -> None:
    """Each try is seen, and what was wrong with it; the run goes on as if there were none."""
    found = attacked(EVERYTHING, shown, tmp_path)
    assert set(interference(found)) == {"handshakes"}
    assert found.tried[shown.value] > 1


def test_with_the_certificate_of_a_node_nothing_is_put_in_anothers_name(tmp_path: Path) -> None:
    """All that the suite knows is tried; each message that is not the node's own is dropped and counted by its kind."""
    found = attacked(EVERYTHING, Shown.NODES, tmp_path)
    seen = interference(found)
    assert (seen["denied"], seen["sessions"]) == (found.tried.total(), 1)
    assert {"put", "delete", "query", "liveliness token", "subscriber", "size"} <= set(found.tried)
    assert "tokens" not in seen  # none came through
    assert f"({THIEF} " in found.run.said if found.run else False


@pytest.mark.long
@pytest.mark.alone
def test_a_flood_ends_at_the_router(tmp_path: Path) -> None:
    """Thousands of forged frames a second: each is counted, and the field does not see one."""
    forgeries = [ALL[name] for name in ("forged threshold", "forged question for the time")]
    found = attacked(Attack(forgeries, seed=2, rate=FLOOD), Shown.NODES, tmp_path)
    seen = interference(found)
    assert (seen["denied"], set(seen)) == (found.tried.total(), {"denied", "sessions"})
    assert found.tried["put"] > FLOOD


def own(what: str, make: Make) -> Bad:
    return Bad(what, "own", ALARM, make)


OWN = [
    own("frames", lambda draw: Sample(inbox(THIEF, draw.known.centre), report(draw), stamp(draw))),
    own("size", lambda draw: Sample(inbox(THIEF, draw.known.centre), bytes(300), stamp(draw))),
    own("telemetry", lambda draw: event(THIEF, pack(plausible(draw)))),
    own("questions", lambda draw: Sample(keys.asked_by(keys.JOIN, THIEF), draw.junk(), means=Means.QUERY)),
    own("tokens", lambda draw: Sample(f"live/{THIEF}/{draw.randrange(10**9)}", means=Means.TOKEN)),
]
"""What the holder of a certificate may send."""


def test_what_is_sent_in_the_nodes_own_name_is_noticed(tmp_path: Path) -> None:
    """Frames that it did not make, telemetry and questions without a seal, a token without a ticket."""
    found = attacked(Attack(OWN, seed=1, rate=50.0), Shown.NODES, tmp_path, pretend=True)
    seen = interference(found)
    assert set(seen) == {"denied", "sessions", "frames", "telemetry", "questions", "tokens"}
    assert found.tried == {"subscriber": 1, "size": found.tried["size"]}


@pytest.mark.long
def test_all_that_the_suite_knows_with_the_certificate_of_a_node(tmp_path: Path) -> None:
    found = attacked(EVERYTHING, Shown.NODES, tmp_path, pretend=True)
    assert {"denied", "sessions", "frames", "telemetry"} <= set(interference(found))
