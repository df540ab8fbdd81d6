"""When an onlooker could not hear what was said. Pure.

Two things tell of it. The bus itself says that it is down, and later that it is back. Or everybody whose presence was seen
is gone, nothing is heard from anybody for as long as a lease, and then somebody is back: so it looks where the bus of the
onlooker was cut off from the one on which the robots are. A gap begins with the last that was heard before.

A world that was silent for longer than it usually is may have told something meanwhile; but it may have been silent because
it was dead, so that this is a reason to ask and not a gap.
"""

from typing import NamedTuple

from lalliance_agents.bus.base import LEASE

#: Why there is a gap.
DOWN = "the bus was not reached"
DESERTED = "nobody was there and nothing was heard"
#: A silence of the world is unusual from so many times its usual length on.
_UNUSUAL = 4.0
#: How much one silence changes what is usual.
_WEIGHT = 0.2
#: Until a bus that is cut off counts as down, in seconds: a lease, and what it takes to see that it is over.
_NOTICED = LEASE + 1.0


class Moment(NamedTuple):
    """One instant on all clocks of an onlooker."""

    real: float
    """In real seconds, since any instant."""
    wall: int
    """The wall clock, in nanoseconds since the epoch."""
    mission: float
    """The onlooker's mission clock, in seconds."""


class Gap(NamedTuple):
    """A time in which what was said was not heard."""

    since: Moment
    until: Moment
    why: str
    answered: bool = False
    """Whether whoever remembers what happened meanwhile was asked for it and has answered."""
    recovered: int = 0
    """Events and decisions that were not known before it answered."""

    @property
    def lasts(self) -> float:
        """How long it was, in real seconds."""
        return self.until.real - self.since.real

    def __str__(self) -> str:
        if not self.answered:
            rest = "what happened then is not known"
        elif self.recovered > 1:
            rest = f"{self.recovered:,} events and decisions of then were asked for afterwards"
        elif self.recovered:
            rest = "1 event or decision of then was asked for afterwards"
        else:
            rest = "nothing had happened that the world remembers"
        return f"{self.why} for {self.lasts:.1f} s; {rest}"


class Gaps:
    """Watches for gaps.

    Attributes:
        lost: since when the bus is down; None: it is not.
        heard: when something was heard for the last time; None: nothing was.
    """

    def __init__(self) -> None:
        self.lost: Moment | None = None
        self.heard: Moment | None = None
        self._present: set[str] = set()
        self._is_deserted = False
        self._world: Moment | None = None
        self._usual: float | None = None

    def goes_down(self, now: Moment) -> None:
        """The bus is down."""
        if self.lost is None:
            heard = self.heard
            self.lost = now if heard is None or now.real - heard.real > _NOTICED else heard

    def comes_back(self, now: Moment) -> Gap | None:
        """The bus is up: the gap that ends with that."""
        if self.lost is None:
            return None
        gap = Gap(self.lost, now, DOWN)
        self.lost, self.heard, self._is_deserted, self._world = None, now, False, None
        return gap

    def hears(self, now: Moment) -> Gap | None:
        """Something was said: the gap that ends with that."""
        heard, self.heard = self.heard, now
        if not self._is_deserted or self.lost is not None:
            return None
        self._is_deserted = False
        return Gap(heard, now, DESERTED) if heard is not None and now.real - heard.real >= LEASE else None

    def meets(self, key: str, present: bool, now: Moment) -> Gap | None:
        """Somebody came or went: the gap that ends with that."""
        if present:
            self._present.add(key)
            return self.hears(now)
        self._present.discard(key)
        self._is_deserted = not self._present
        return None

    def hears_world(self, now: Moment) -> bool:
        """The world has said how the mission stands: whether it had been silent for unusually long."""
        before, self._world = self._world, now
        if before is None:
            return False
        silence = now.real - before.real
        if self._usual is not None and silence > max(LEASE, _UNUSUAL * self._usual):
            return True
        self._usual = silence if self._usual is None else (1 - _WEIGHT) * self._usual + _WEIGHT * silence
        return False
