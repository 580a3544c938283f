"""Electing a head by radio, among the nodes that sense a target while none leads (Zhou et al., dynamic clusters).

Each contender has a key, 0 for the loudest target, and waits for a back-off that is linear in it, plus a jitter. At its
end it claims to lead, unless it heard of a better bid: a bid is (key, id), and the lower one wins. Suppression alone is
not enough. A contender that misses the claim makes one of its own, so with loss there are several heads as a rule.
Therefore everybody hands on the best bid it knows:

- a claim is followed by one repeat, a ``join-claim`` in which the claimer names itself, and by up to two more as long
  as it hears of no support;
- whoever hears of a bid better than all before gives up its own, and relays the better one, with one repeat;
- whoever hears of a worse one than it knows answers by the best, ``ANSWERS`` times for each best bid. A contender that
  still waits claims at once instead: its turn would have come before.

At the end of its election, ``settle_ns`` after its first word, a node has won if it claimed and knows of no better bid.
Its first word is its own claim, or what it heard first that kept it from making one.

Nodes that do not sense the target relay, too, so an election passes a hole in the field. They relay only what they hear
from a node that senses, or what corrects a worse bid that they know. So it ends one hop outside the nodes that sense,
and does not flood the field. Answers are not limited so: a hole two relays wide is passed by what they answer.

A node sends at most ``MOST_FRAMES`` frames in an election: a claim, and no more than ``OF_ONE`` relays of one bid and
``MOST_RELAYS`` in all, whatever it hears.

Elections are numbered as the terms that they begin (``lease.py``). A higher number supersedes the election under way; a
contender of that one takes part in the new one. Messages of a lower number are outdated; those that expired are void.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Final, Literal, NamedTuple

from trackfield.draw import uniform
from trackfield.protocols.lease import MOST_NUMBER
from trackfield.role import NEIGHBOURHOOD, CancelTimer, Effect, Ignored, IllegalEvent, Send, SetTimer
from trackfield.wire.error import WireError
from trackfield.wire.keys import check_id
from trackfield.wire.peers import MOST_KEY, Claim, JoinClaim

KINDS: Final = frozenset({"claim", "join-claim"})
CLAIM: Final = "claim"
RELAY: Final = "relay"
SETTLE: Final = "settle"
TIMERS: Final = frozenset({CLAIM, RELAY, SETTLE})
WEAKEST: Final = MOST_KEY - 1
"""The weakest key of a node that senses the target: in a ``join-claim`` ``MOST_KEY`` means that it does not."""
ROUNDS: Final = 2
"""A relay and its repeat."""
ANSWERS: Final = 2
"""How often a node answers worse bids by the same one."""
OF_ONE: Final = ROUNDS + ANSWERS
MOST_RELAYS: Final = 15
"""In an election whose best bid keeps changing."""
MOST_FRAMES: Final = 1 + MOST_RELAYS

Outcome = Literal["", "won", "joined", "stopped"]
"""Of an election: not over yet; this node leads; another one does; a head was known before it was over."""


class Bid(NamedTuple):
    """A claim to lead; the lower one wins, by key and then by id."""

    key: int
    id: str


@dataclass(frozen=True, slots=True)
class Race:
    """An election as one node knows it; ``number`` 0: none yet.

    ``own`` is its key, None if it does not sense the target; ``waiting``: its back-off is not over before ``due_ns``.
    ``best`` is the best bid that it made or heard, valid up to the step ``expires``; its own bid would be so up to
    ``own_expires``. ``due`` relays are to come and ``relayed`` were sent of the best bid, a claim counted with them;
    ``relays`` were sent in all.

    ``sensing`` are the nodes in earshot that sense the target, with their keys. ``supporters`` are those that said by
    a ``join-claim`` that they support this node.
    """

    number: int = 0
    own: int | None = None
    own_expires: int = 0
    waiting: bool = False
    due_ns: int = 0
    best: Bid | None = None
    expires: int = 0
    claimed: bool = False
    due: int = 0
    relayed: int = 0
    relays: int = 0
    sensing: Mapping[str, int] = field(default_factory=dict)
    supporters: frozenset[str] = frozenset()
    outcome: Outcome = ""

    @property
    def open(self) -> bool:
        """Whether it is under way."""
        return self.number > 0 and not self.outcome


Step = tuple[Race, tuple[Effect, ...]]

_STOPS: Final = (CancelTimer(CLAIM), CancelTimer(RELAY), CancelTimer(SETTLE))


@dataclass(frozen=True)
class Election:
    """The part of node ``id`` of a run with ``seed``.

    ``backoff_ns`` is that of the weakest key, ``jitter_ns`` comes on top. A relay leaves within ``hop_ns``, its repeat
    within another one, so that the frames of neighbours are spread over that time. ``settle_ns``: see ``settling_ns``.
    """

    id: str
    seed: int
    settle_ns: int
    hop_ns: int = 20_000_000
    backoff_ns: int = 200_000_000
    jitter_ns: int = 10_000_000

    @property
    def longest_ns(self) -> int:
        """How long an election takes a contender at most, if no other one supersedes it."""
        return self.backoff_ns + self.jitter_ns + self.settle_ns

    def begin(self, race: Race, now: int, number: int, key: int, expires: int) -> Step:
        """This node senses the target with this key: it contends, in the election under way if there is one.

        The number is that of the term to be led, from 1 to ``MOST_NUMBER``, and above that of an election that is over;
        otherwise nothing happens, and neither does if the node contends already. The key is cut to 0 .. ``WEAKEST``.
        """
        own = min(max(key, 0), WEAKEST)
        if race.number < number <= MOST_NUMBER:
            race, effects = self._back_off(Race(number, own, expires), now)
            return race, (*_STOPS, *effects)
        if not race.open or race.own is not None:
            return race, ()
        race = replace(race, own=own, own_expires=expires)
        if race.best is not None and race.best < Bid(own, self.id):
            return self._answer(race, now)  # the best one is to know that this node senses, too
        return self._back_off(race, now)

    def hear(self, race: Race, now: int, message: Claim | JoinClaim, sender: str, step: int) -> Step:
        """A claim or relay was received, at this filter step; all nodes handle them, whether they sense or not."""
        bid = _bid_of(message, sender)
        if bid is None:
            return race, (Ignored("malformed"),)
        if reason := self._useless(race, message, sender, step, bid):
            return race, (Ignored(reason),)
        before: tuple[Effect, ...] = ()
        if message.number > race.number:
            race, before = self._supersede(race, now, message.number)
        race = self._noted(race, message, sender, bid)
        race, effects = self._weigh(race, now, message, bid)
        return race, (*before, *effects)

    def ring(self, race: Race, now: int, timer: str) -> Step:
        """One of ``TIMERS``; one that means nothing now is passed over. Raises ``IllegalEvent`` for any other."""
        match timer:
            case "claim":
                return self._claim(race, now) if race.waiting else (race, ())
            case "relay":
                return self._relay(race, now) if race.due else (race, ())
            case "settle":
                return self._settle(race) if race.open else (race, ())
        raise IllegalEvent(f"election has no timer {timer!r}")

    def stop(self, race: Race) -> Step:
        """A head of this or a higher term is known: nothing more is sent."""
        outcome: Outcome = race.outcome or "stopped"
        return replace(race, waiting=False, due=0, relayed=OF_ONE, outcome=outcome), _STOPS

    # --- what is heard -------------------------------------------------------------------------------------------

    def _useless(self, race: Race, message: Claim | JoinClaim, sender: str, step: int, bid: Bid) -> str:
        """Why a message is of no use; empty if it is."""
        if sender == self.id:
            return "own"
        if message.expires < step:
            return "void"
        if message.number > MOST_NUMBER:
            return "implausible"
        if message.number < max(race.number, 1) or (message.number == race.number and race.outcome == "stopped"):
            return "outdated"
        if bid.id == self.id and (message.number > race.number or not race.claimed):
            return "implausible"  # it says that this node claimed, which it did not in this life
        return ""

    def _supersede(self, race: Race, now: int, number: int) -> Step:
        """An election of a higher number; a contender of the one under way takes part."""
        after = Race(number)
        if not race.open or race.own is None:
            return after, _STOPS
        after, effects = self._back_off(replace(after, own=race.own, own_expires=race.own_expires), now)
        return after, (*_STOPS, *effects)

    def _noted(self, race: Race, message: Claim | JoinClaim, sender: str, bid: Bid) -> Race:
        """Who senses the target, and whom it supports."""
        key = message.own if isinstance(message, JoinClaim) else message.key
        supporters = race.supporters - {sender}
        if bid.id == self.id:
            supporters |= {sender}
        sensing = race.sensing if key > WEAKEST else {**race.sensing, sender: key}
        return replace(race, sensing=sensing, supporters=supporters)

    def _weigh(self, race: Race, now: int, message: Claim | JoinClaim, bid: Bid) -> Step:
        """What to do about a bid, and the message that it came by."""
        if bid.id == self.id or bid == race.best:
            return race, ()
        if race.waiting and race.own is not None and Bid(race.own, self.id) < bid:
            return self._claims_at(race, max(now, min(race.due_ns, now + self._wait_ns(race, self.hop_ns))))
        if race.best is not None and race.best < bid:
            return self._answer(race, now)
        if race.outcome:
            return race, (Ignored("outdated"),)
        first = race.best is None
        told = isinstance(message, Claim) or message.own < MOST_KEY or not first or race.own is not None
        after = replace(race, best=bid, expires=message.expires, waiting=False, due=0, relayed=0)
        effects: tuple[Effect, ...] = (CancelTimer(CLAIM), CancelTimer(RELAY))
        if first:
            effects = (*effects, SetTimer(SETTLE, now + self.settle_ns))
        after, relays = self._schedule(after, now, ROUNDS if told else 0)
        return after, (*effects, *relays)

    # --- what is sent --------------------------------------------------------------------------------------------

    def _back_off(self, race: Race, now: int) -> Step:
        """Wait for its turn; if a worse bid is known already, that is now."""
        wait_ns = self.backoff_ns * (race.own or 0) // MOST_KEY if race.best is None else 0
        jitter_ns = int(self.jitter_ns * uniform(self.seed, self.id, "election", race.number))
        after, timers = self._claims_at(replace(race, waiting=True, due=0), now + wait_ns + jitter_ns)
        return after, (CancelTimer(RELAY), *timers)

    def _claims_at(self, race: Race, due_ns: int) -> Step:
        timers = SetTimer(CLAIM, due_ns), SetTimer(SETTLE, due_ns + self.settle_ns)
        return replace(race, due_ns=due_ns), timers

    def _claim(self, race: Race, now: int) -> Step:
        """The back-off is over, and no better bid was heard."""
        own = race.own or 0
        after = replace(race, waiting=False, claimed=True, best=Bid(own, self.id), expires=race.own_expires, due=0)
        after, effects = self._schedule(replace(after, relayed=1), now + self.hop_ns // 2, ROUNDS - 1)
        return after, (Send(Claim(race.number, own, race.own_expires), NEIGHBOURHOOD), *effects)

    def _answer(self, race: Race, now: int) -> Step:
        """By the best bid; not if that is relayed soon in any case."""
        return (race, ()) if race.due else self._schedule(race, now, 1)

    def _schedule(self, race: Race, now: int, frames: int) -> Step:
        """So many relays of the best bid, as far as there may be more; the first within ``hop_ns``."""
        due = min(frames, OF_ONE - race.relayed, MOST_RELAYS - race.relays)
        if due <= 0:
            return race, ()
        return replace(race, due=due), (SetTimer(RELAY, now + self._wait_ns(race, self.hop_ns)),)

    def _relay(self, race: Race, now: int) -> Step:
        """Hand on the best bid; a repeat follows in the second half of the next ``hop_ns``."""
        if race.best is None:
            return replace(race, due=0), ()
        after = replace(race, due=race.due - 1, relayed=race.relayed + 1, relays=race.relays + 1)
        alone = race.best.id == self.id and not race.supporters
        if alone and not after.due and after.relayed < OF_ONE and after.relays < MOST_RELAYS:
            after = replace(after, due=1)
        own = MOST_KEY if race.own is None else race.own
        relay = JoinClaim(race.number, race.best.key, race.best.id.encode(), own, race.expires)
        sent = Send(relay, NEIGHBOURHOOD)
        if not after.due:
            return after, (sent,)
        pause_ns = self.hop_ns // 2 + self._wait_ns(after, self.hop_ns // 2)
        return after, (sent, SetTimer(RELAY, now + pause_ns))

    def _wait_ns(self, race: Race, most_ns: int) -> int:
        """The jitter of the next relay; its own for each number and relay."""
        return int(most_ns * uniform(self.seed, self.id, "election", race.number, race.relays))

    def _settle(self, race: Race) -> Step:
        won = race.claimed and race.best is not None and race.best.id == self.id
        return replace(race, waiting=False, outcome="won" if won else "joined"), (CancelTimer(CLAIM),)


def settling_ns(frame_ns: int, *, hop_ns: int, jitter_ns: int, hops: int = 3) -> int:
    """How long an election lasts after a node's first word, if a frame takes ``frame_ns`` at most, with access.

    A better claim leaves no later than a worse one that hears nothing of it, but for the jitter. From its sender to
    all in ``hops`` hops its claim and each relay may have to be repeated, within twice ``hop_ns``. If one of them is
    lost all the same, a worse bid that goes on is answered: another hop.
    """
    return jitter_ns + (hops + 1) * (2 * hop_ns + frame_ns)


def _bid_of(message: Claim | JoinClaim, sender: str) -> Bid | None:
    """The bid that a message makes or hands on; None if it names nobody."""
    if isinstance(message, Claim):
        return Bid(message.key, sender)
    try:
        return Bid(message.key, check_id(message.head.decode("ascii")))
    except (WireError, UnicodeDecodeError):
        return None
