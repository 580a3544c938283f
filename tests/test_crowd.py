"""How full the channel will be, by ``validate``, against what it then was; and who may send for how long."""

from __future__ import annotations

import pytest

from launcher.plan.forecast.foresight import foresee
from launcher.plan.forecast.warnings import summary, warnings
from launcher.plan.prepare import load, planned
from launcher.record.figures.channel import air_of_run, channel_metrics, is_fiction
from launcher.record.metrics import run_metrics
from launcher.record.virtually import simulate
from launcher.records import Plan

DENSE = ("link.radio=lora868", "link.sf=7", "link.ack=0", "field.spacing_m=25", "fusion.deadline_s=0.9")
"""A dense field of LoRa nodes: a dozen reports in each step."""


def plan_of(*settings: str, seed: int = 1) -> Plan:
    return planned(load("zhai-spcpf", settings=[*settings, f"seed={seed}"]))


@pytest.mark.parametrize("settings", [(), ("link.ack=0",), DENSE, (*DENSE, "link.sf=9"), ("link.radio=mica2",)])
def test_what_is_expected_is_what_comes(settings: tuple[str, ...]) -> None:
    """All reports leave as foreseen: shares within a factor of 1.25 or 0.03, use within a factor of 1.5.

    Reports have at most the length that is foreseen, which is that of the longest.
    """
    last = dict(setting.split("=") for setting in settings)
    plan = plan_of(*(f"{key}={value}" for key, value in last.items()))
    seen = foresee(plan).crowd
    assert seen is not None
    ledger, _ = simulate(plan)
    found = channel_metrics(air_of_run(ledger))
    for expected, came in ((seen.overlapped, found["overlapped_share"]), (seen.spared, found["spared_share"])):
        assert expected == pytest.approx(came, rel=0.25, abs=0.03)
    for expected, came in ((seen.use_mean, found["use_mean"]), (seen.use_peak, found["use_peak"])):
        assert came / 1.5 <= expected <= came * 1.5


def test_of_many_reports_some_seconds_are_enough(monkeypatch: pytest.MonkeyPatch) -> None:
    plan = plan_of(*DENSE)
    whole = foresee(plan).crowd
    monkeypatch.setattr("launcher.plan.forecast.crowd.MOST_TRIED", 200)
    some = foresee(plan).crowd
    assert whole is not None
    assert some is not None
    assert some.air.expected < whole.air.expected / 2
    assert some.use_mean == pytest.approx(whole.use_mean, rel=0.3)
    assert some.use_peak == pytest.approx(whole.use_peak, rel=0.1)
    assert some.overlapped == pytest.approx(whole.overlapped, abs=0.1)
    assert some.every * some.air.expected == pytest.approx(whole.air.expected)


@pytest.mark.parametrize(("settings", "red"), [((), False), (("link.ack=0",), True)])
def test_the_warning_is_that_of_the_report(settings: tuple[str, ...], red: bool) -> None:
    plan = plan_of(*settings)
    told = [text for text in warnings(plan, foresee(plan)) if "will be a fiction" in text]
    assert bool(told) is red
    assert is_fiction(run_metrics(plan, *simulate(plan))) is red


def test_who_sends_by_wire_or_not_at_all_crowds_nothing() -> None:
    assert foresee(plan_of("link.model=fixed")).crowd is None
    plan = plan_of()
    empty = foresee(plan)
    assert empty.crowd is not None
    assert any(line.startswith("on the channel at fusion, ") for line in summary(plan, empty))


def test_each_role_has_a_duty_of_its_own_and_the_loud_another() -> None:
    plan = plan_of("link.radio=lora868", "link.sf=7")
    duties = {(duty.what, duty.id == "fusion"): duty.allowed_s for duty in foresee(plan).duties}
    assert duties == {("reports", False): 36.0, ("acknowledgements", True): 36.0}
    loud = plan_of("link.radio=lora868", "link.sf=7", "radio={fusion = {tx_dbm = 20.0}}")
    duties = {(duty.what, duty.id == "fusion"): duty.allowed_s for duty in foresee(loud).duties}
    assert duties == {("reports", False): 36.0, ("acknowledgements", True): 360.0}
    assert foresee(plan_of()).duties == ()
