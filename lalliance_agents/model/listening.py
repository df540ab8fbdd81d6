"""What one message does: to what is known of who is where (`hearing`), and to the attempts that are watched (`monitor`).

Nearly every message only goes on with what the one before it said. Such a refresh moves three instants and nothing else, so
that it costs next to nothing, and leaves alone all that was foreseen of the steps to come.
"""

import math
from collections.abc import Mapping
from enum import Enum, auto

from lalliance_agents.model.events import Heard
from lalliance_agents.model.hearing import Hearing, Presence
from lalliance_agents.model.knowledge import Knowledge
from lalliance_agents.model.monitor import Attempt
from lalliance_agents.model.motivation import Motivation


class News(Enum):
    """What a message tells."""

    NONE = auto()
    """Nothing, or what the message before it told: a refresh."""
    ELSEWHERE = auto()
    """That a teammate known to be present is on none of this robot's tasks; whom it may have left is not silent yet."""
    SOME = auto()
    """Anything else."""


class Listener:
    """Takes in messages for one robot.

    Args:
        me: the robot's name.
        sets: its behaviour sets, by task.
        hearing: where it keeps whom it heard.
        knowledge: whose monitors watch the attempts of teammates.
    """

    def __init__(self, me: str, sets: Mapping[str, Motivation], hearing: Hearing, knowledge: Knowledge) -> None:
        self._me = me
        self._sets = sets
        self._hearing = hearing
        self._monitors = knowledge.monitors

    def is_refresh(self, event: Heard, now: float) -> bool:
        """Whether what is heard at `now` only goes on with what was heard before (see `Mind.is_refresh`)."""
        return self._continued(event, now) is not None

    def hear(self, event: Heard, now: float) -> News:
        """Take in a message; what it told."""
        going_on = self._continued(event, now)
        if going_on is not None:
            presence, attempt = going_on
            presence.last = now
            if presence.contact is not None:
                presence.contact.last = now
            if attempt is not None:
                attempt.last, attempt.active_for = now, event.active_for
            return News.NONE
        if event.robot == self._me:
            return News.NONE
        known = self._hearing.presences.get(event.robot)
        told = News.ELSEWHERE if known and not known.absent and event.task not in self._sets else News.SOME
        self._take_in(event, now)
        return told

    def _continued(self, event: Heard, now: float) -> tuple[Presence, Attempt | None] | None:
        """What a refresh goes on with; None if it is no refresh."""
        task = event.task
        presence = self._hearing.presences.get(event.robot)
        if presence is None or presence.absent:
            return None
        if task is None or task not in self._sets:
            return (presence, None) if presence.task is None else None
        contact = presence.contact
        if contact is None or presence.task != task or contact.expected != event.expected:
            return None
        if not 0.0 <= event.active_for < math.inf:
            return None
        if self._sets[task].sensory_feedback == 0:
            return presence, None  # no attempt is watched at a task that cannot be worked on
        attempt = self._monitors[task].continued(event.robot, now, event.active_for)
        return None if attempt is None else (presence, attempt)

    def _take_in(self, event: Heard, now: float) -> None:
        for task, monitor in self._monitors.items():
            if task != event.task:
                monitor.elsewhere(event.robot, now)
        if event.task is None or event.task not in self._sets:
            self._hearing.heard(event.robot, now)
            return
        if not 0.0 <= event.active_for < math.inf:
            # No attempt can be so long; the teammate is there, and nothing more is known.
            self._hearing.heard(event.robot, now, event.task)
            return
        workable = self._sets[event.task].sensory_feedback == 1
        fresh = workable and self._monitors[event.task].observe(event.robot, now, event.active_for)
        self._hearing.heard_on(
            event.robot, event.task, now, active_for=event.active_for, expected=event.expected, fresh=fresh
        )
