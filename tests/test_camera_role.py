"""The emulated camera: what it replies and when, how it turns, and what it makes of anything else."""

from __future__ import annotations

from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from camera.ptz import MOST_WAITING, VERTICAL_NS, Camera
from tests.cameras import MS, Driven, obedient
from tests.test_visca import ADDRESSES, GOLDEN, TO_ONE
from trackfield.models.pointing import Direction
from trackfield.role import NS, Ignored, Started
from trackfield.wire import visca
from trackfield.wire.visca import CANCELLED, FULL, NO_SOCKET, NOT_EXECUTABLE, SYNTAX, Ack, Answer, Completion, Failure

FAST = visca.Absolute(0x18, 0x14, 0x370, 0)
"""100 deg to the right at 80 deg/s: 1.25 s."""
BACK = visca.Absolute(0x0C, 0x14, 0, 300)
ZOOM = visca.Zoom(0x200)
STOP = visca.Drive(0x18, 0x14, 0, 0)


@pytest.fixture
def camera() -> Driven:
    """A camera that has been on for a while."""
    camera = Driven()
    camera.until(NS)
    camera.said.clear()
    return camera


def test_it_begins_at_rest_ahead_and_asks_for_an_address() -> None:
    camera = Driven()
    assert [visca.reply_of(packet) for _, packet in camera.said] == [visca.Replied(1, visca.Changed())]
    assert camera.motions == [(0, ((0, 0), (0, 0), 80, 50))]
    assert camera.states == [(0, "ready")]
    assert camera.timer == -1  # it waits to be told something


# --- when it replies --------------------------------------------------------------------------------------------------


@given(st.integers(0, 10 * VERTICAL_NS))
def test_it_acknowledges_within_one_vertical_cycle(at: int) -> None:
    camera = Driven()
    camera.until(at)
    camera.said.clear()
    camera.tell(FAST)
    camera.until(at + NS // 10)
    ((when, packet),) = camera.said
    assert packet == b"\x90\x41\xff"
    assert 0 < when - at <= VERTICAL_NS == NS * 1001 // 60000
    assert camera.motions[-1][0] == when  # and begins to turn


def test_it_completes_a_turn_within_a_cycle_after_it_is_there(camera: Driven) -> None:
    camera.tell(FAST)
    camera.until(10 * NS)
    (acked, _), (completed, packet) = camera.said
    assert packet == b"\x90\x51\xff"
    assert 0 <= completed - acked - 1.25 * NS < VERTICAL_NS
    assert camera.states[-2:] == [(acked, "moving"), (completed, "ready")]
    assert camera.look() == (100, 0)


def test_what_takes_no_time_is_completed_in_the_cycle_after_its_ack(camera: Driven) -> None:
    camera.tell(ZOOM)
    camera.until(2 * NS)
    (acked, ack), (completed, completion) = camera.said
    assert (ack, completion) == (b"\x90\x41\xff", b"\x90\x51\xff")
    assert completed - acked == VERTICAL_NS


def test_it_looks_at_one_packet_in_a_cycle(camera: Driven) -> None:
    camera.tell(visca.Ask("power"), visca.Ask("zoom"), visca.Ask("speeds"))
    camera.until(2 * NS)
    times = [when for when, _ in camera.said]
    assert [after - before for before, after in pairwise(times)] == [VERTICAL_NS] * 2
    power, zoom, speeds = camera.replies()
    assert (power, zoom, speeds) == (Answer(b"\x02"), Answer(bytes(4)), Answer(b"\x18\x14"))


def test_more_packets_than_it_can_look_at_are_lost(camera: Driven) -> None:
    camera.tell(*[visca.Ask("power")] * (MOST_WAITING + 3))
    camera.until(2 * NS)
    assert len(camera.replies()) == MOST_WAITING
    assert camera.ignored == ["more packets than it can look at"] * 3


# --- sockets ----------------------------------------------------------------------------------------------------------


def test_two_commands_have_two_sockets_and_an_inquiry_needs_none(camera: Driven) -> None:
    camera.tell(FAST, ZOOM, ZOOM, visca.Ask("power"))
    camera.until(camera.now + 3 * VERTICAL_NS)
    assert camera.replies() == [Ack(1), Ack(2), Completion(2), Ack(2)]
    camera.until(camera.now + VERTICAL_NS)
    assert camera.replies() == [Completion(2), Answer(b"\x02")]
    camera.until(camera.now + 2 * NS)
    assert camera.replies() == [Completion(1)]


def test_a_turn_waits_for_the_one_before_and_a_third_command_finds_the_buffer_full(camera: Driven) -> None:
    camera.tell(FAST, BACK, visca.Home(), ZOOM, STOP, visca.Ask("power"), visca.Cancel(3))
    camera.until(camera.now + 7 * VERTICAL_NS)
    full = Failure(0, FULL)
    assert camera.replies() == [Ack(1), Ack(2), full, full, full, Answer(b"\x02"), Failure(3, NO_SOCKET)]
    camera.until(camera.now + NS)
    assert camera.look().pan > 80
    camera.until(camera.now + 10 * NS)
    assert camera.replies() == [Completion(1), Completion(2)]
    assert camera.look() == (0, 25)
    (turned, second), (began, first) = camera.motions[-1], camera.motions[-2]
    assert 0 <= turned - began - first.lasts_s * NS < VERTICAL_NS
    assert second.start == first.to


def test_a_socket_is_free_again_after_its_completion(camera: Driven) -> None:
    for _ in range(3):
        camera.tell(FAST)
        camera.until(camera.now + 2 * NS)
        assert camera.replies() == [Ack(1), Completion(1)]


def test_a_cancelled_turn_stops_where_it_is_and_is_not_completed(camera: Driven) -> None:
    camera.tell(FAST)
    camera.until(2 * NS)
    camera.replies()
    before = camera.look()
    camera.tell(visca.Cancel(1))
    camera.until(10 * NS)
    assert camera.replies() == [Failure(1, CANCELLED)]
    assert before.pan < camera.look().pan <= before.pan + 80 * VERTICAL_NS / NS
    assert camera.states[-1][1] == "ready"
    camera.tell(visca.Cancel(1))
    camera.until(11 * NS)
    assert camera.replies() == [Failure(1, NO_SOCKET)]


@pytest.mark.parametrize("socket", [0, 2, 3, 15])
def test_a_socket_that_does_nothing_cannot_be_cancelled(socket: int, camera: Driven) -> None:
    camera.tell(FAST, visca.Cancel(socket))
    camera.until(4 * NS)
    assert camera.replies() == [Ack(1), Failure(socket, NO_SOCKET), Completion(1)]
    assert camera.look() == (100, 0)


def test_when_a_turn_is_cancelled_the_one_that_waits_begins_from_there(camera: Driven) -> None:
    camera.tell(FAST, BACK)
    camera.until(camera.now + NS // 2)
    camera.tell(visca.Cancel(1))
    camera.until(camera.now + VERTICAL_NS)
    assert camera.replies() == [Ack(1), Ack(2), Failure(1, CANCELLED)]
    (began, first), (turned, second) = camera.motions[-2:]
    assert second.start == first.at((turned - began) / NS)
    assert 30 < second.start.pan < 50
    camera.until(10 * NS)
    assert camera.replies() == [Completion(2)]
    assert camera.look() == (0, 25)


def test_a_turn_that_waits_is_cancelled_and_the_other_goes_on(camera: Driven) -> None:
    camera.tell(FAST, BACK, visca.Cancel(2))
    camera.until(10 * NS)
    assert camera.replies() == [Ack(1), Ack(2), Failure(2, CANCELLED), Completion(1)]
    assert camera.look() == (100, 0)


def test_a_stop_ends_a_turn(camera: Driven) -> None:
    camera.tell(FAST)
    camera.until(camera.now + NS // 2)
    camera.tell(STOP)
    camera.until(10 * NS)
    assert camera.replies() == [Ack(1), Failure(1, CANCELLED), Ack(2), Completion(2)]
    assert 30 < camera.look().pan < 50


# --- how it turns -----------------------------------------------------------------------------------------------------


@given(
    st.sampled_from(visca.PAN_SPEEDS),
    st.sampled_from(visca.TILT_SPEEDS),
    st.integers(-visca.PAN_STEPS, visca.PAN_STEPS),
    st.integers(-visca.TILT_STEPS, visca.TILT_STEPS),
)
def test_each_axis_turns_at_its_own_speed(pan_speed: int, tilt_speed: int, pan: int, tilt: int) -> None:
    camera = Driven()
    camera.tell(visca.Absolute(pan_speed, tilt_speed, pan, tilt))
    camera.until(VERTICAL_NS)
    took_s = max(abs(pan) * 100 / 0x370 / (pan_speed * 10 / 3), abs(tilt) * 25 / 0x12C / (tilt_speed * 2.5))
    camera.until(camera.now + NS)
    assert abs(camera.look().pan) == pytest.approx(min(abs(pan) * 100 / 0x370, pan_speed * 10 / 3))
    assert abs(camera.look().tilt) == pytest.approx(min(abs(tilt) * 25 / 0x12C, tilt_speed * 2.5))
    camera.until(100 * NS)
    when, packet = camera.said[-1]
    assert packet == b"\x90\x51\xff"
    assert when / NS == pytest.approx(VERTICAL_NS / NS + max(took_s, VERTICAL_NS / NS), abs=VERTICAL_NS / NS)
    camera.said.clear()
    camera.tell(visca.Ask("position"))
    camera.until(101 * NS)
    assert camera.replies() == [Answer(visca.nibbles(pan) + visca.nibbles(tilt))]


def test_a_relative_turn_begins_where_it_is_and_ends_at_the_limit(camera: Driven) -> None:
    camera.tell(visca.Relative(0x18, 0x14, 440, -30))
    camera.until(3 * NS)
    assert camera.look() == pytest.approx((50, -2.5))
    camera.tell(visca.Relative(0x18, 0x14, -88, 12))
    camera.until(5 * NS)
    assert camera.look() == pytest.approx((40, -1.5))
    camera.tell(visca.Relative(0x18, 0x14, 0x7FFF, -0x8000))
    camera.until(9 * NS)
    assert camera.look() == (100, -25)
    assert camera.replies() == [Ack(1), Completion(1)] * 3


def test_a_drive_is_completed_when_it_has_begun_and_goes_on_to_the_limit(camera: Driven) -> None:
    camera.tell(visca.Drive(0x0C, 0x14, -1, 1))
    camera.until(camera.now + 2 * VERTICAL_NS)
    assert camera.replies() == [Ack(1), Completion(1)]
    assert camera.states[-1][1] == "moving"
    camera.until(10 * NS)
    assert camera.look() == (-100, 25)
    assert camera.states[-1][1] == "ready"
    assert camera.replies() == []


@pytest.mark.parametrize("pan", [-1, 0, 1])
@pytest.mark.parametrize("tilt", [-1, 0, 1])
def test_a_drive_turns_the_axes_that_it_names(pan: int, tilt: int, camera: Driven) -> None:
    camera.tell(visca.Absolute(0x18, 0x14, 88, -24))
    camera.until(4 * NS)
    camera.tell(visca.Drive(0x18, 0x14, pan, tilt))
    camera.until(10 * NS)
    assert camera.look() == (pan * 100 or 10, tilt * 25 or -2)


def test_a_drive_stops_when_it_is_told(camera: Driven) -> None:
    camera.tell(visca.Drive(0x06, 0x14, 1, 0))
    camera.until(camera.now + NS)
    camera.tell(STOP)
    camera.until(camera.now + NS)
    pan, tilt = camera.look()
    assert pan == pytest.approx(20, abs=20 * VERTICAL_NS / NS)
    assert tilt == 0
    assert camera.states[-1][1] == "ready"
    assert camera.replies() == [Ack(1), Completion(1)] * 2


@pytest.mark.parametrize("command", [visca.Home(), visca.Reset()])
def test_it_goes_home_at_full_speed(command: visca.Command, camera: Driven) -> None:
    camera.tell(FAST)
    camera.until(3 * NS)
    camera.tell(command)
    camera.until(6 * NS)
    assert camera.motions[-1][1] == ((100, 0), (0, 0), 80, 50)
    assert camera.look() == (0, 0)
    assert camera.replies() == [Ack(1), Completion(1)] * 2


def test_where_it_looks_is_told_while_it_turns(camera: Driven) -> None:
    camera.tell(FAST)
    camera.until(camera.now + NS // 2)
    camera.tell(visca.Ask("position"))
    camera.until(camera.now + VERTICAL_NS)
    ack, answer = camera.replies()
    assert ack == Ack(1)
    assert isinstance(answer, Answer)
    pan = visca.signed(answer.data[:4])
    assert pan is not None
    assert visca.pan_deg(pan) == pytest.approx(camera.look().pan, abs=80 * VERTICAL_NS / NS + 0.06)
    assert 30 < visca.pan_deg(pan) < 45


def test_it_says_that_it_is_an_evi_d30_with_two_sockets(camera: Driven) -> None:
    """Sony is 0020h, an EVI-D30 0402h (EVI-D70 manual, p. 34); the edition of its program is our own choice."""
    camera.tell(visca.Ask("version"))
    camera.until(2 * NS)
    ((_, packet),) = camera.said
    assert packet.hex(" ").upper() == "90 50 00 20 04 02 00 01 02 FF"


def test_the_zoom_is_kept(camera: Driven) -> None:
    camera.tell(ZOOM, visca.Ask("zoom"))
    camera.until(2 * NS)
    assert camera.replies()[-1] == Answer(bytes([0, 2, 0, 0]))


# --- power, clearing, addresses ---------------------------------------------------------------------------------------


def test_without_power_it_does_nothing_and_says_so(camera: Driven) -> None:
    camera.tell(FAST)
    camera.until(camera.now + NS // 2)
    camera.tell(visca.Power(on=False))
    camera.until(camera.now + 2 * VERTICAL_NS)
    assert camera.replies() == [Ack(1), Failure(1, CANCELLED), Ack(2), Completion(2)]
    assert 30 < camera.look().pan < 50
    assert camera.states[-1][1] == "off"
    rests = camera.look()
    camera.tell(FAST, ZOOM, visca.Ask("position"), visca.Ask("power"))
    camera.until(camera.now + NS)
    assert camera.replies() == [
        Failure(1, NOT_EXECUTABLE),
        Failure(1, NOT_EXECUTABLE),
        Failure(0, NOT_EXECUTABLE),
        Answer(b"\x03"),
    ]
    assert camera.look() == rests


def test_with_power_again_it_turns_home(camera: Driven) -> None:
    camera.tell(FAST)
    camera.until(3 * NS)
    camera.tell(visca.Power(on=False))
    camera.until(4 * NS)
    camera.replies()
    camera.tell(visca.Power(on=True))
    camera.until(camera.now + 2 * VERTICAL_NS)
    assert camera.replies() == [Ack(1), Completion(1)]
    assert camera.states[-1][1] == "moving"
    camera.until(8 * NS)
    assert camera.look() == (0, 0)
    assert camera.states[-1][1] == "ready"


def test_power_on_of_a_camera_that_is_on_changes_nothing(camera: Driven) -> None:
    camera.tell(FAST, visca.Power(on=True))
    camera.until(4 * NS)
    assert camera.replies() == [Ack(1), Ack(2), Completion(2), Completion(1)]
    assert camera.look() == (100, 0)


@pytest.mark.parametrize(("to", "reply"), [(1, Completion(0)), (visca.EVERYBODY, visca.Cleared())])
def test_it_forgets_all_commands_and_stops(to: int, reply: visca.Reply, camera: Driven) -> None:
    camera.tell(FAST)
    camera.until(camera.now + NS // 2)
    camera.tell(visca.Clear(), address=to)
    camera.tell(visca.Ask("power"))  # came later: it is not forgotten
    camera.until(10 * NS)
    assert camera.replies() == [Ack(1), reply, Answer(b"\x02")]
    assert 30 < camera.look().pan < 45


def test_an_address_is_taken_and_the_next_one_handed_on(camera: Driven) -> None:
    camera.tell(visca.AddressSet(3))
    camera.tell(visca.Ask("power"), address=3)
    camera.tell(visca.Ask("power"), address=1)
    camera.until(2 * NS)
    packets = [packet.hex(" ").upper() for _, packet in camera.said]
    assert packets == ["88 30 04 FF", "B0 50 02 FF"]
    assert camera.ignored == ["for another camera"]
    camera.packet(bytes.fromhex("82 01 06 09 FF"))
    camera.packet(bytes.fromhex("83 01 06 09 FF"))
    camera.until(3 * NS)
    assert camera.said[-1][1].hex(" ").upper() == "B0 60 02 FF"
    assert camera.ignored == ["for another camera", "no packet for it"]


def test_an_eighth_camera_has_no_address(camera: Driven) -> None:
    camera.tell(visca.AddressSet(8), visca.Ask("power"))
    camera.until(2 * NS)
    assert [packet.hex(" ").upper() for _, packet in camera.said] == ["88 30 08 FF", "90 50 02 FF"]


# --- anything else ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("text", [text for text in GOLDEN["syntax errors"] if text.startswith("81")])
def test_what_it_does_not_know_or_take_is_a_syntax_error(text: str, camera: Driven) -> None:
    camera.packet(bytes.fromhex(text))
    camera.until(2 * NS)
    assert camera.replies() == [Failure(0, SYNTAX)]
    assert len(camera.motions) == 1


@pytest.mark.parametrize(
    "text", ["82 01 06 09 FF", "88 01 06 09 FF", "88 01 06 04 FF", "90 41 FF", "81 FF", "81 01", "", "FF", "FF FF FF"]
)
def test_what_is_not_for_it_alone_has_no_reply(text: str, camera: Driven) -> None:
    camera.packet(bytes.fromhex(text))
    camera.until(2 * NS)
    assert camera.said == []
    assert len(camera.ignored) == 1


def test_it_obeys_its_peer_alone(camera: Driven) -> None:
    camera.packet(visca.command_packet(FAST), sender="stranger")
    camera.until(2 * NS)
    assert (camera.said, camera.ignored) == ([], ["unexpected"])


def test_a_camera_that_restarts_knows_nothing(camera: Driven) -> None:
    """As one that lost its power."""
    role = Camera(id="camera", peer="control")
    state, effects = role.handle(role.begin(), Started(5 * NS))
    assert (state.head.motion.to, state.address) == (Direction(0, 0), 1)
    assert not any(isinstance(one, Ignored) for one in effects)


GARBAGE = st.binary(max_size=16)
SENSE = st.builds(visca.command_packet, TO_ONE, ADDRESSES | st.just(1) | st.just(1))
ALL = st.sampled_from([visca.command_packet(one) for one in (visca.AddressSet(1), visca.AddressSet(7))])
ALL |= st.just(visca.command_packet(visca.Clear(), visca.EVERYBODY))


@given(st.lists(st.tuples(st.integers(0, 200 * MS), st.one_of(GARBAGE, SENSE, SENSE, ALL)), max_size=30))
def test_whatever_comes_it_keeps_its_promises(packets: list[tuple[int, bytes]]) -> None:
    """Each command that it took ends once; it has two at most; it never jumps, nor turns beyond its reach."""
    camera = obedient(packets)
    open_sockets: set[int] = set()
    for _, packet in camera.said:
        replied = visca.reply_of(packet)
        assert replied is not None
        match replied.reply:
            case Ack(socket):
                assert socket in visca.SOCKETS
                assert socket not in open_sockets
                open_sockets.add(socket)
            case Completion(0) | visca.Cleared():
                open_sockets.clear()
            case Completion(socket) | Failure(socket, visca.CANCELLED):
                open_sockets.remove(socket)
    assert not open_sockets
    for (before, first), (after, second) in pairwise(camera.motions):
        assert second.start == first.at((after - before) / NS)
    for _, motion in camera.motions:
        assert abs(motion.to.pan) <= 100
        assert abs(motion.to.tilt) <= 25
    assert camera.states[-1][1] in ("ready", "off")
    assert camera.timer == -1
