"""What goes through the air between simulated robots, without a look at the many messages that say nothing new.

A robot says several times a second what it is on. All that such a refresh changes at the hearer is when it last heard the
teammate, and that matters only when it is next asked. So a message waits at its link until the hearer looks, and of a row of
refreshes it then takes the last; only a message that may be news wakes the hearer when it comes. A message may be news if it
says something else than the message before on the same link, if it comes out of order, or after a silence that the hearer may
have noticed.

Where no rule touches any link of a speaker, and each hearer has been sent what it has to say, its links are settled: nobody
waits for its refreshes, and they are not even made before somebody looks. Then the last that has come stands for all.
"""

from collections import Counter, deque
from collections.abc import Callable
from typing import NamedTuple, Protocol

from lalliance_agents.bus.link import RuledLink
from lalliance_agents.model.events import Heard
from lalliance_agents.model.parameters import EARLY


class Spoken(NamedTuple):
    """One message on its way to one hearer."""

    arrives: float
    incarnation: int
    seq: int
    trial: int
    content: object
    """What it says, as an object of its own: refreshes share it."""
    heard: Heard
    first: int | None = None
    """The number of the first of the row that it stands for, if it stands for more than itself."""


class Hearer(Protocol):
    """Whoever listens at the end of a link."""

    name: str
    tau: float
    trial: int
    there: bool
    """Whether it has a process, and with that somewhere for messages to arrive."""
    heeded: set[str]
    """The teammates on settled links: they cannot fall silent unnoticed."""

    def doubt(self, instant: float, now: float) -> None:
        """A teammate that was heeded until `now` may fall silent, but not before `instant`."""

    @property
    def runs(self) -> bool:
        """Whether its process runs."""


class Speaker(Protocol):
    """Whoever speaks at the beginning of a link."""

    name: str
    trial: int
    longest_gap: float
    """The longest time between two of its announcements, in seconds."""
    latest: Spoken | None
    """While its links are settled: the last refresh that has come, as far as they were made."""
    unmade: float
    """When the first comes that was not made; infinite if its links are not settled."""

    def catch_up(self, now: float) -> None:
        """Make all that has come until `now`."""

    def unsettle(self, now: float) -> None:
        """Somebody waits for what it says next: from now on its announcements go out one by one."""


class AirLink:
    """The way of one robot's messages to one teammate.

    Args:
        speaker: the robot.
        hearer: the teammate.
        announce_news: called with the instant at which a message comes that may be news.
        every_step: whether every message is taken for news.
    """

    def __init__(
        self, speaker: Speaker, hearer: Hearer, announce_news: Callable[["AirLink", float], None], *, every_step: bool
    ) -> None:
        self.speaker = speaker
        self.sender = speaker.name
        self.hearer = hearer
        self.rule: RuledLink | None = None
        self.waiting: deque[Spoken] = deque()
        self.received = self.stale = self.strange = self.lost = 0
        #: fault -> messages that it touched.
        self.effects: Counter[str] = Counter()
        self._announce_news = announce_news
        self._every_step = every_step
        self._content: object = None
        self._task: str | None = None
        self._latest = 0.0
        self._incarnation = self._seq = -1
        self._can_settle = not every_step and speaker.longest_gap < hearer.tau - EARLY
        #: Whether what is said here is not made before somebody looks.
        self.settled = False

    def __repr__(self) -> str:
        return f"<link {self.sender} -> {self.hearer}, {len(self.waiting)} waiting>"

    def forget(self, now: float, task: str | None = None) -> None:
        """Whatever comes next is news, if it is about `task`: the hearer has changed its mind, not the speaker."""
        if task is None or task == self._task:
            self.speaker.unsettle(now)
            self._content = None

    def reset(self, now: float) -> None:
        """The hearer begins a new life, which has heard nothing."""
        self.speaker.unsettle(now)
        self.waiting.clear()
        self._content = None
        self._incarnation = self._seq = -1
        self.received = self.stale = self.strange = self.lost = 0
        self.effects.clear()

    def send(self, spoken: Spoken) -> None:
        """A message is on its way; `arrives` is when it would come if no rule touched it."""
        if not self.hearer.there:
            return
        if self.rule is None:
            self._put(spoken)
            return
        verdict = self.rule.verdict(spoken.incarnation, spoken.seq)
        self.effects.update(verdict.faults)
        if not verdict.delays:
            self.lost += 1
        for late in verdict.delays:
            self._put(spoken if late == 0.0 else self._delayed(spoken, late))

    def _delayed(self, spoken: Spoken, late: float) -> Spoken:
        # What is under way for about as long as a silence that would be noticed is a thing of its own.
        content = spoken.content if late < self.hearer.tau / 2 else object()
        return spoken._replace(arrives=spoken.arrives + late, content=content)

    def _put(self, spoken: Spoken) -> None:
        arrives = spoken.arrives
        gap = arrives - self._latest
        if spoken.content is self._content and 0.0 <= gap <= self.hearer.tau - EARLY and not self._every_step:
            self._latest = arrives
            self.waiting.append(spoken)
            return
        self._content, self._task = spoken.content, spoken.heard.task
        if gap >= 0.0:
            self._latest = arrives
            self.waiting.append(spoken)
        else:
            later = [one for one in self.waiting if one.arrives > arrives]
            for _ in later:
                self.waiting.pop()
            self.waiting.append(spoken)
            self.waiting.extend(later)
        self._announce_news(self, arrives)

    def can_settle(self, content: object, comes: float) -> bool:
        """Whether what the speaker goes on to say, first what `comes` then, is no news to the hearer, if it has one."""
        if not self.hearer.there:
            return True
        steady = self._can_settle and self.rule is None and self._latest <= comes
        understood = self.speaker.trial == self.hearer.trial and self._content is content
        return steady and understood and self.hearer.runs

    def settle(self) -> None:
        """From now on nobody waits for what comes."""
        self.settled = True
        if self.hearer.there:
            self.hearer.heeded.add(self.sender)

    def unsettle(self, now: float) -> None:
        """Have what has come, and was not taken, wait like everything else."""
        self.settled = False
        latest = self.speaker.latest
        if not self.hearer.there:
            return
        if latest is not None:
            self._latest = latest.arrives
            if self._is_new(latest):
                self.waiting.append(latest)
        self.hearer.heeded.discard(self.sender)
        self.hearer.doubt(self._latest + self.hearer.tau - EARLY, now)

    def _is_new(self, spoken: Spoken) -> bool:
        return (spoken.incarnation, spoken.seq) > (self._incarnation, self._seq)

    def take(self, now: float, *, each: bool) -> list[Spoken]:
        """What has come until `now` and is fresh: of a row of refreshes the last, or `each` of them."""
        waiting = self.waiting
        if self.settled:
            speaker = self.speaker
            if speaker.unmade <= now:
                speaker.catch_up(now)
            latest = speaker.latest
            if latest is not None and self._is_new(latest):
                if not waiting:
                    return [latest] if self._accept(latest) else []
                waiting.append(latest)
        taken = []
        last: Spoken | None = None
        while waiting and waiting[0].arrives <= now:
            spoken = waiting.popleft()
            if not self._is_new(spoken):
                self.stale += 1
                continue
            if not self._accept(spoken):
                continue
            if last is not None and (each or last.content is not spoken.content):
                taken.append(last)
            last = spoken
        if last is not None:
            taken.append(last)
        return taken

    def _accept(self, spoken: Spoken) -> bool:
        """Count a message that has come; whether it is of the trial that the hearer is in."""
        row = 1 if spoken.first is None else spoken.seq - max(self._seq, spoken.first - 1)
        self._incarnation, self._seq = spoken.incarnation, spoken.seq
        self.received += row
        if spoken.trial == self.hearer.trial:
            return True
        self.strange += row
        return False
