"""Who was heard, and when: the paper's comm_received and robots_present.

The Appendix asks only whether some message came within a span of time that ends now, or began at the start of the trial.
For that it is enough to keep, per teammate and task, the first and the last instant. Nothing here grows with the number of
messages. Robots are kept in the order in which they were first heard, so that nothing depends on hash order.
"""

import math
from collections.abc import Collection
from dataclasses import dataclass

from lalliance_agents.model.equations import in_window
from lalliance_agents.model.parameters import EARLY


@dataclass(slots=True, eq=False)
class Contact:
    """One teammate heard on one task during this trial. Instants are the hearer's own."""

    robot: str
    first: float
    """The first message of all."""
    since: float
    """The first message of the current attempt (erratum 16)."""
    last: float
    """The latest message."""
    started: float
    """When the current attempt began, by the teammate's own account of how long it has been active."""
    expected: float
    """What the teammate announced as its own expected time, in seconds."""
    lapsed_at: float | None = None
    """When it was noticed that the teammate is not heard on the task any more."""
    noticed: bool = False
    """Whether a step has counted the first message."""


_NOBODY: dict[str, Contact] = {}


@dataclass(slots=True)
class Presence:
    """Where one teammate was last heard, and when."""

    last: float
    task: str | None = None
    """The task that its latest message was about, if this robot can do it."""
    contact: Contact | None = None
    """The contact that its latest message belongs to; None if it was idle, or said nothing sensible."""
    absent: bool = False
    """Whether a step has found it silent for tau since it was last heard."""
    lapses: int = 0
    """How often that has happened in this trial."""
    lapsed_at: float = -math.inf
    """When it happened last."""


class Hearing:
    """Everything one robot has heard in this trial.

    Args:
        silence_timeout: tau, in seconds.
        closed: whether windows include their later end (erratum 7).
        per_attempt: whether first-heard windows begin with the current attempt (erratum 16, mended).
    """

    def __init__(self, silence_timeout: float, *, closed: bool, per_attempt: bool) -> None:
        self._tau = silence_timeout
        self._closed = closed
        self._per_attempt = per_attempt
        #: Where each robot heard in this trial was last heard, in the order of their first messages.
        self.presences: dict[str, Presence] = {}
        self._present: list[str] | None = None
        self._contacts: dict[str, dict[str, Contact]] = {}
        #: Those of the contacts that have not lapsed, and those that no step has counted yet.
        self._lasting: list[Contact] = []
        self._news: list[Contact] = []

    def forget(self) -> None:
        """Begin a trial in which nobody has been heard."""
        self.presences.clear()
        self._present = None
        self._contacts.clear()
        self._lasting.clear()
        self._news.clear()

    def heard(self, robot: str, now: float, task: str | None = None) -> None:
        """`robot` is there, and its message was about `task`."""
        presence = self.presences.get(robot)
        if presence is None or presence.absent:
            self._present = None
        if presence is None:
            presence = self.presences[robot] = Presence(now)
        presence.last, presence.task, presence.contact, presence.absent = now, task, None, False

    def heard_on(self, robot: str, task: str, now: float, *, active_for: float, expected: float, fresh: bool) -> None:
        """`robot` is on `task`; `fresh` if this is not the attempt it was last heard with."""
        self.heard(robot, now, task)
        contacts = self._contacts.setdefault(task, {})
        contact = contacts.get(robot)
        if contact is None:
            contact = contacts[robot] = Contact(robot, now, now, now, now - active_for, expected)
            self._lasting.append(contact)
            self._news.append(contact)
        elif fresh:
            contact.since = now
            contact.started = now - active_for
            if self._per_attempt and contact.noticed:
                contact.noticed = False
                self._news.append(contact)
        if contact.lapsed_at is not None:
            contact.lapsed_at = None
            self._lasting.append(contact)
        contact.last = now
        contact.expected = expected
        self.presences[robot].contact = contact

    def watch(self, task: str, *, on: bool) -> None:
        """From now on it matters who ceases to be heard on `task`, or, as the task is complete, does not."""
        contacts = self.contacts(task)
        self._lasting = [contact for contact in self._lasting if contact not in contacts]
        if on:
            self._lasting += [contact for contact in contacts if contact.lapsed_at is None]

    def has_heard(self, robots: frozenset[str]) -> bool:
        """Whether each of `robots` was heard in this trial."""
        return robots <= self.presences.keys()

    def is_present(self, robot: str, now: float) -> bool:
        """Whether `robot` was heard within tau, about anything."""
        presence = self.presences.get(robot)
        return presence is not None and in_window(presence.last, now - self._tau, now, self._closed)

    def robots_present(self, now: float) -> list[str]:
        """robots_present: the teammates heard within tau; the robot itself is not among them (erratum 3 adds it)."""
        return [robot for robot in self.presences if self.is_present(robot, now)]

    def silences(self, now: float) -> dict[str, float]:
        """How long ago each teammate was last heard, in seconds."""
        return {robot: max(now - presence.last, 0.0) for robot, presence in self.presences.items()}

    def contacts(self, task: str) -> Collection[Contact]:
        """All teammates heard on `task` in this trial."""
        return self._contacts.get(task, _NOBODY).values()

    def on_task(self, task: str, now: float) -> list[Contact]:
        """The teammates heard on `task` within tau."""
        contacts = self.contacts(task)
        return [contact for contact in contacts if self.is_on(contact, now)] if contacts else []

    def is_on(self, contact: Contact, now: float) -> bool:
        """comm_received(i, k, j, t - tau, t): whether a teammate was heard on its task within tau."""
        return in_window(contact.last, now - self._tau, now, self._closed)

    def anybody_on(self, task: str, now: float) -> bool:
        """Whether any teammate was heard on `task` within tau."""
        return bool(self.on_task(task, now))

    def heard_until(self, contact: Contact, instant: float) -> bool:
        """comm_received(i, k, j, 0, instant): whether it was heard on it by then, in this trial (erratum 16)."""
        return in_window(self.beginning(contact), -math.inf, instant, self._closed)

    def is_news(self, contact: Contact, before: float, now: float) -> bool:
        """comm_received in (before, now], and not in (0, before]: first heard since the last communication check.

        A message can come at the very instant of a check, but after it. So that it is counted once all the same, each
        check marks what it has counted (`note_checked`); the literal reading goes by instants alone and misses it.
        """
        if self._closed:
            return not contact.noticed
        return in_window(self.beginning(contact), before, now, closed=False)

    def any_news(self, task: str, before: float, now: float) -> bool:
        """Whether any teammate was first heard on `task` since the last communication check."""
        if self._closed and not self._news:
            return False
        return any(self.is_news(contact, before, now) for contact in self.contacts(task))

    def note_checked(self, until: float = math.inf) -> bool:
        """All that was first heard up to `until` has been counted: it is no news to the next step. Whether any was."""
        if not self._news:
            return False
        counted = [contact for contact in self._news if self.beginning(contact) <= until]
        for contact in counted:
            contact.noticed = True
        self._news = [contact for contact in self._news if not contact.noticed]
        return bool(counted)

    def beginning(self, contact: Contact) -> float:
        """The instant with which first-heard windows begin (erratum 16)."""
        return contact.since if self._per_attempt else contact.first

    def note_lapses(self, now: float) -> None:
        """Remember who has ceased to be heard, and the instant at which each teammate ceases to be heard on a task."""
        if self._closed and now < self.next_lapse():
            return
        self._present = None
        for robot, presence in self.presences.items():
            was_absent, presence.absent = presence.absent, not self.is_present(robot, now)
            if presence.absent and not was_absent:
                presence.lapses += 1
                presence.lapsed_at = now
        for contact in self._lasting:
            if not self.is_on(contact, now):
                contact.lapsed_at = now
        self._lasting = [contact for contact in self._lasting if contact.lapsed_at is None]

    def next_lapse(self, heeded: Collection[str] = ()) -> float:
        """The earliest instant at which a step may find that somebody has ceased to be heard, there or on a task.

        Args:
            heeded: teammates that are known to go on with what they said last.
        """
        last = math.inf
        for robot, presence in self.presences.items():
            if presence.last < last and not presence.absent and robot not in heeded:
                last = presence.last
        for contact in self._lasting:
            if contact.last < last and not (
                contact.robot in heeded and self.presences[contact.robot].contact is contact
            ):
                last = contact.last
        return last + self._tau - EARLY

    def present(self, now: float) -> list[str]:
        """`robots_present` after `note_lapses` of the same instant: the same list, until somebody comes or goes."""
        if self._present is None or not self._closed:
            self._present = self.robots_present(now)
        return self._present
