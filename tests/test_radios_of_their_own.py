"""``[radio.<role>]``: transmit power and device of single roles and processes."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from launcher.plan.plan import make_plan
from launcher.plan.prepare import load
from launcher.records import Plan
from trackfield.drivers.spec import ProcessSpec, link_of, links_of
from trackfield.errors import ScenarioError
from trackfield.link.energy import DEVICES, NODE_UW, sending_at

FIELD = ("link.model=lognormal_prr", "link.radio=802154-0dbm")


def plan(*settings: str) -> Plan:
    return make_plan(load("bus", settings=[*FIELD, *settings]), run="r")


def process(of: Plan, id: str) -> ProcessSpec:
    return next(p for p in of.processes if p.id == id)


def snr_db(of: Plan, src: str, dst: str) -> Any:
    return links_of(of.run, of.processes)["field"].snr_db(src, dst)  # type: ignore[attr-defined]


def test_a_role_and_a_process_may_have_their_own_power() -> None:
    plain, own = plan(), plan("radio.node.tx_dbm=-10", "radio.fusion.tx_dbm=-3", "radio.n000.tx_dbm=-5")
    for src, dst, less_db in (("n001", "fusion", 10), ("fusion", "n001", 3), ("n000", "fusion", 5)):
        assert snr_db(own, src, dst) == pytest.approx(snr_db(plain, src, dst) - less_db)


def test_a_process_knows_the_powers_of_its_peers_and_of_nobody_else() -> None:
    one = plan("radio.node.tx_dbm=-10", "radio.n000.tx_dbm=-5")
    assert process(one, "n000").tx_dbms == {"n000": -5.0}
    assert process(one, "n001").tx_dbms == {"n001": -10.0}
    centre = process(one, "fusion")
    assert centre.tx_dbms == {id: -5.0 if id == "n000" else -10.0 for id in centre.peers}
    mine, all_ = link_of(one.run, [centre]), link_of(one.run, one.processes)
    assert mine.reception("n000", "fusion", 20) == all_.reception("n000", "fusion", 20)


def test_what_it_costs_follows() -> None:
    own = plan("radio.node.tx_dbm=-10", "radio.fusion.device=sx1276", "energy.centre_battery_j=100")
    assert process(own, "n000").powers["field"].send_uw == 33_600 + NODE_UW
    assert process(own, "n000").powers["field"].listen_uw == DEVICES["cc2420"].listen_uw
    assert process(own, "fusion").powers["field"].send_uw == DEVICES["sx1276"].send_uw


def test_the_power_of_the_link_costs_as_much() -> None:
    assert process(plan("link.tx_dbm=-25"), "n000").powers["field"].send_uw == 25_500 + NODE_UW
    assert process(plan(), "n000").powers["field"].send_uw == DEVICES["cc2420"].send_uw


@pytest.mark.parametrize(
    ("device", "tx_dbm", "radio_uw"),
    [
        ("cc2420", -4.0, 43_650),
        ("cc2420", -40.0, 25_500),
        ("cc2420", 0.0, 52_200),
        ("cc2420-20dbm", 10.0, 352_200),
        ("sx1276", 10.0, 80_850),
        ("sx1276", 14.0, 145_200),
    ],
)
def test_power_between_those_of_the_data_sheet(device: str, tx_dbm: float, radio_uw: int) -> None:
    assert sending_at(device, tx_dbm).send_uw == radio_uw + NODE_UW


def test_at_its_nominal_power_a_device_draws_what_it_always_did() -> None:
    for device, tx_dbm in (("cc2420", 0), ("cc2420-20dbm", 20), ("sx1276", 14), ("wifi11b", 15)):
        assert sending_at(device, tx_dbm) == DEVICES[device]


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        (("radio.nod.tx_dbm=1",), "radio.nod: there is no role or process 'nod'; did you mean node?"),
        (("radio.node.tx=1",), "radio.node.tx: unknown; expected one of tx_dbm, device"),
        (("radio.node.tx_dbm=99",), "radio.node.tx_dbm: is 99; expected a number from -60 to 40"),
        (("radio.node.device=cc2421",), "radio.node.device: is 'cc2421'; expected one of cc2420, cc2420-20dbm, "),
        (
            ("radio.n000.tx_dbm=10",),
            "radio.n000.tx_dbm: is 10, and the device cc2420 has at most 0; expected at most 0",
        ),
        (("radio.node=3",), "radio: is {'node': 3}; expected a table by role or id, like { node = { tx_dbm = 10 } }"),
    ],
)
def test_what_is_wrong_is_said(settings: tuple[str, ...], message: str) -> None:
    with pytest.raises(ScenarioError) as caught:
        plan(*settings)
    assert message in str(caught.value)


def test_a_power_without_effect_is_refused() -> None:
    what = (
        "radio.node.tx_dbm: is set, and with link model fixed no frame depends on it; expected link model lognormal_prr"
    )
    with pytest.raises(ScenarioError, match=what):
        make_plan(load("bus", settings=["link.model=fixed", "radio.node.tx_dbm=3"]), run="r")


def test_they_are_written_and_read_again(tmp_path: Path) -> None:
    scenario = load("bus", settings=[*FIELD, "radio.node.tx_dbm=-10", "radio.fusion.device=sx1276"])
    (tmp_path / "again.toml").write_text(scenario.to_toml())
    again = load(str(tmp_path / "again.toml"))
    assert again.radio == scenario.radio
    assert again.plain()["radio"] == {"fusion": {"device": "sx1276"}, "node": {"tx_dbm": -10.0}}
