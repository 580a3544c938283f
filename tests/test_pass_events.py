"""Reports of passes gathered into events: when one is over, what belongs to it, what is dropped."""

from hypothesis import given
from hypothesis import strategies as st

from trackfield.filters.solving.events import Ended, Event, Events, Pass

EVENTS = Events(close_s=1.5, apart_s=5.0, least=4, most=8)
CLUSTER = Events(close_s=1.5, apart_s=5.0, least=4, most=8, sensors=5)
DT = 0.5


def report(sensor, time_s):
    return Pass(sensor, 0.0, 0.0, time_s, 60.0, 0.8)


def yes(passes):
    return True


def story(events, told, until_s=30.0, fits=yes):
    """What ended, with the time of the step in which it did; ``told`` has (sensor, CPA s, step's instant s)."""
    event, ended = Event(), []
    for k in range(round(until_s / DT) + 1):
        now = k * DT
        passes = tuple(report(sensor, cpa - now) for sensor, cpa, at in told if at == now)
        event, over = events.step(event, passes, DT, fits)
        ended += [(now, one) for one in over]
    return ended


def summary(ended):
    return [(now, "".join(sorted(one.sensor for one in passes)), again) for now, (passes, again) in ended]


def pass_of(sensors, first_s=10.0, every_s=0.8, lag_s=1.2):
    """Each passed ``every_s`` after the one before it, and heard of with the first step ``lag_s`` later."""
    cpas = [first_s + i * every_s for i in range(len(sensors))]
    return [(id, cpa, -(-(cpa + lag_s) // DT) * DT) for id, cpa in zip(sensors, cpas, strict=True)]


def test_an_event_is_over_when_no_report_came_for_so_long():
    """The last CPA is at 13.2 s, known at 14.5 s; at 16 s no CPA can have followed within 1.5 s."""
    assert summary(story(EVENTS, pass_of("abcde"))) == [(16.0, "abcde", False)]


def test_an_event_is_over_when_all_sensors_have_reported():
    assert summary(story(CLUSTER, pass_of("abcde"))) == [(14.5, "abcde", False)]


def test_an_event_has_at_most_eight_reports():
    """A target that passes sensor after sensor is one event after the other."""
    ended = story(EVENTS, pass_of("abcdefghijklm"))
    assert [who for _, who, _ in summary(ended)] == ["abcdefgh", "ijklm"]


def test_more_reports_than_an_event_has_in_one_step_are_two_events():
    ended = story(EVENTS, [(f"s{i:02}", 10.0 + i / 100.0, 11.5) for i in range(12)])
    assert [[one.sensor for one in passes] for _, (passes, _) in ended] == [
        [f"s{i:02}" for i in range(8)],
        [f"s{i:02}" for i in range(8, 12)],
    ]


def test_too_few_reports_wait_for_others():
    """Three are no event yet: a slow target may take seconds from one sensor to the next."""
    assert summary(story(EVENTS, pass_of("abc"))) == [(18.0, "abc", False)]
    assert summary(story(EVENTS, pass_of("abcde", every_s=4.0))) == [
        (25.0, "abcd", False),
        (29.0, "abcde", True),
    ]


def test_an_event_goes_on_if_a_further_report_belongs_to_it():
    told = [*pass_of("abcd"), ("e", 14.4, 16.5)]
    assert summary(story(EVENTS, told)) == [(15.5, "abcd", False), (18.0, "abcde", True)]


def test_reports_far_apart_are_of_different_events():
    told = [("x", 4.0, 5.5), *pass_of("abcde")]
    assert summary(story(EVENTS, told)) == [(10.5, "x", False), (16.0, "abcde", False)]


def test_a_report_after_the_gap_begins_the_next_event_at_once():
    told = [("x", 8.0, 9.0), ("y", 13.5, 13.5)]
    assert summary(story(Events(1.5, 5.0, 4, 8), told))[0] == (13.5, "x", False)


def test_a_repeated_report_is_dropped():
    told = [*pass_of("abcde"), ("a", 10.02, 14.0), ("c", 12.5, 14.0)]
    assert story(EVENTS, told) == story(EVENTS, pass_of("abcde"))


def test_a_stray_report_before_that_of_the_same_sensor_is_dropped():
    """Of four reports that are no pass together, or of fewer, the one before is a false one."""
    told = [("b", 8.0, 9.0), *pass_of("abcde")]
    assert story(EVENTS, told) == story(EVENTS, pass_of("abcde"))
    told = [("d", 9.5, 10.5), *pass_of("abcde")]
    assert story(EVENTS, told, fits=lambda passes: False) == story(EVENTS, pass_of("abcde"))


def test_a_sensor_that_is_passed_again_begins_the_next_event():
    told = [*pass_of("abcd"), *pass_of("abcd", first_s=13.0)]
    assert [who for _, who, _ in summary(story(EVENTS, told))] == ["abcd", "abcd"]


def test_a_second_target_close_behind_is_the_next_event():
    told = [*pass_of("abcde"), *pass_of("abcde", first_s=14.0)]
    assert [who for _, who, _ in summary(story(CLUSTER, told))] == ["abcde", "abcde"]
    assert [again for *_, again in summary(story(CLUSTER, told))] == [False, False]


def test_a_late_report_of_a_full_event_begins_nothing():
    """With all sensors of a cluster heard, an earlier report of one of them is of no event."""
    told = [*pass_of("abcde"), ("b", 6.5, 15.0)]
    assert story(CLUSTER, told) == story(CLUSTER, pass_of("abcde"))
    told = [*pass_of("abcdefgh"), ("x", 3.0, 20.0), ("y", 15.0, 20.0)]
    assert story(EVENTS, told) == story(EVENTS, pass_of("abcdefgh"))


def test_times_are_relative_to_the_step_in_which_the_event_is_over():
    ((now, ended),) = story(CLUSTER, pass_of("abcde"))
    assert [round(now + one.time_s, 6) for one in ended.passes] == [10.0, 10.8, 11.6, 12.4, 13.2]


@given(st.permutations("abcde"))
def test_the_order_within_a_step_does_not_matter(order):
    told = {"a": -1.4, "b": -1.2, "c": -1.2, "d": -1.1, "e": -1.0}
    event, ended = CLUSTER.step(Event(), tuple(report(id, told[id]) for id in order), DT, yes)
    assert event.over
    assert ended == (Ended(tuple(report(id, told[id]) for id in "abcde"), again=False),)
