"""What a robot tells of itself to whoever looks: what it received, whether it kept its pace, what it is motivated to do."""

from collections import Counter

from lalliance_agents.agent import translate
from lalliance_agents.bus.faulty import FaultyBus
from lalliance_agents.bus.messenger import Messenger
from lalliance_agents.model.hearing import Presence
from lalliance_agents.model.mind import Mind
from lalliance_agents.wire.keys import Kind
from lalliance_agents.wire.messages import Drop, Reception

#: Pairs of sender and reason of which a report tells how many messages were dropped: those with the most.
MOST_DROPS = 32


class Reports:
    """Counters of one robot, and the messages that carry them.

    Args:
        messenger: what is counted, and what carries the reports.
        bus: what counts the messages that faults touched before the messenger saw them.
    """

    def __init__(self, messenger: Messenger, bus: FaultyBus) -> None:
        self._messenger = messenger
        self._bus = bus
        self._received: Counter[str] = Counter()
        self._ticks = 0
        self._missed = 0

    def begin(self) -> None:
        """The mission begins: control periods count from here."""
        self._ticks = self._missed = 0

    def heard(self, teammate: str) -> None:
        """A presence message of `teammate` was used."""
        self._received[teammate] += 1

    def ticked(self, missed: int) -> None:
        """A control step was made after `missed` periods without one."""
        self._ticks += 1
        self._missed += missed

    def send(self, mind: Mind, now: float, *, final: bool) -> None:
        """Publish what came and went so far."""
        silences = mind.hearing.silences(now)
        self._messenger.send(
            Kind.LINK,
            sent=self._messenger.sent,
            received=self._messenger.received,
            dropped=dict(self._messenger.dropped + self._bus.dropped),
            drops=self._drops(),
            teammates={
                robot: _reception(count, mind.hearing.presences.get(robot), silences.get(robot), now)
                for robot, count in self._received.items()
            },
            effects=self._bus.effects(),
            ticks=self._ticks,
            missed=self._missed,
            final=final,
        )

    def _drops(self) -> list[Drop]:
        dropped = (self._messenger.dropped_of + self._bus.dropped_of).most_common(MOST_DROPS)
        return [Drop(sender=sender, reason=reason, count=count) for (sender, reason), count in dropped]

    def motivations(self, mind: Mind) -> bytes:
        """The packed message with all motivations and their factors."""
        sets = {task: translate.scalars(factors) for task, factors in mind.factors().items()}
        return self._messenger.compose(Kind.MOTIVATION, active=mind.active, sets=sets)


def _reception(received: int, presence: Presence | None, silence: float | None, now: float) -> Reception:
    """What came from one teammate, and whether it was found silent, if it was heard in this trial."""
    lapses = presence.lapses if presence is not None else 0
    lost_for = max(now - presence.lapsed_at, 0.0) if presence is not None and presence.absent else None
    return Reception(received=received, silence=silence, lapses=lapses, lost_for=lost_for)
