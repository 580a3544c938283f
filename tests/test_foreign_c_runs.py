"""The C node of docs/microcontroller.md takes a place of a run, with a stand-in for zenoh-pico."""

from __future__ import annotations

import json
from pathlib import Path

import pyarrow.parquet as pq
import pytest

from tests.foreign import waiting
from tests.pico.bridge import Bridged
from tests.running import PATIENCE_S
from tests.test_foreign_c import ROOT, SANE, build
from trackfield.drivers.exchange.seal import TOKEN

FIELD = ("zhai-spcpf", "--nodes", "4", "--set", "field.spacing_m=150", "--set", "sensor.threshold=0.5")
STEPS = ("--set", "target.steps=8")
ID, SECRET = "n002", "a secret of the field"


@pytest.fixture(scope="module")
def node(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The program."""
    folder, pico = tmp_path_factory.mktemp("c"), ROOT / "tests" / "pico"
    build(folder, "-std=gnu11", *SANE, "-I", pico, "plain_node.c", pico / "stand_in.c", "-o", "node", "-lm", "-pthread")
    return folder / "node"


@pytest.mark.parametrize("token", [pytest.param(None, marks=pytest.mark.long), SECRET])
def test_it_counts_as_any_other(node: Path, tmp_path: Path, token: str | None, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its clock is not the launcher's; a second one at its place, and one with another token, get none."""
    monkeypatch.delenv(TOKEN, raising=False)
    if token is not None:
        monkeypatch.setenv(TOKEN, token)
    with waiting(tmp_path / "run", [ID], *FIELD, *STEPS) as (run, settings):
        client = json.loads(settings.read_text())
        (endpoint,), name = client["connect"]["endpoints"], client["namespace"]

        def start(*given: str | None) -> Bridged:
            return Bridged([node, name, *(one for one in given if one is not None)], endpoint)

        if token is not None:
            said = "control/clock: no answer, or none with the seal of the token\n"
            assert start(ID, "another").ended(PATIENCE_S) == (1, said)
        first = start(ID, token)
        run.started()
        code, said = start(ID, token).ended(PATIENCE_S)
        assert (code, said) == (1, f"control/claim/{ID}: {ID} is taken: a process lives there\n")
        code, said = run.finish()
        assert first.ended(PATIENCE_S) == (0, "")
    assert code == (0 if token is None else 1), said  # a question without the seal of the run is counted
    rows = [row for row in pq.read_table(run.folder / "messages.parquet").to_pylist() if row["src"] == ID]
    assert [(row["step"], row["outcome"]) for row in rows] == [(step, "delivered") for step in range(1, 9)]
    assert {row["sent_ns"] % 10**9 for row in rows} == {0}
    assert {tuple(row["values"]) for row in rows} == {(211.37, 71.24)}
    interference = run.metrics()["interference"]
    assert interference.pop("questions") == (0 if token is None else 1)
    assert set(interference.values()) <= {0, None}
