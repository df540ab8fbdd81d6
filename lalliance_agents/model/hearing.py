"""Who was heard, and when: the paper's comm_received and robots_present.

The Appendix asks only whether some message came within a span of time that ends now, or began at the start of the trial.
For that it is enough to keep, per teammate and task, the first and the last instant. Nothing here grows with the number of
messages. Robots are kept in the order in which they were first heard, so that nothing depends on hash order.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass

from lalliance_agents.model.equations import in_window


@dataclass(slots=True)
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
        self._last: dict[str, float] = {}
        self._contacts: dict[str, dict[str, Contact]] = {}

    def forget(self) -> None:
        """Begin a trial in which nobody has been heard."""
        self._last.clear()
        self._contacts.clear()

    def heard(self, robot: str, now: float) -> None:
        """`robot` is there."""
        self._last[robot] = now

    def heard_on(self, robot: str, task: str, now: float, *, active_for: float, expected: float, fresh: bool) -> None:
        """`robot` is on `task`; `fresh` if this is not the attempt it was last heard with."""
        self.heard(robot, now)
        contacts = self._contacts.setdefault(task, {})
        contact = contacts.get(robot)
        if contact is None:
            contacts[robot] = Contact(robot, now, now, now, now - active_for, expected)
            return
        if fresh:
            contact.since = now
            contact.started = now - active_for
            contact.noticed = contact.noticed and not self._per_attempt
        contact.last = now
        contact.expected = expected
        contact.lapsed_at = None

    def has_heard(self, robots: frozenset[str]) -> bool:
        """Whether each of `robots` was heard in this trial."""
        return robots <= self._last.keys()

    def is_present(self, robot: str, now: float) -> bool:
        """Whether `robot` was heard within tau, about anything."""
        last = self._last.get(robot, -math.inf)
        return in_window(last, now - self._tau, now, self._closed)

    def robots_present(self, now: float) -> list[str]:
        """The teammates heard within tau; the robot itself is not among them (erratum 3 adds it)."""
        return [robot for robot in self._last if self.is_present(robot, now)]

    def silences(self, now: float) -> dict[str, float]:
        """How long ago each teammate was last heard, in seconds."""
        return {robot: max(now - last, 0.0) for robot, last in self._last.items()}

    def contacts(self, task: str) -> Iterator[Contact]:
        """All teammates heard on `task` in this trial."""
        return iter(self._contacts.get(task, {}).values())

    def is_on(self, contact: Contact, now: float) -> bool:
        """comm_received(i, k, j, t - tau, t)."""
        return in_window(contact.last, now - self._tau, now, self._closed)

    def anybody_on(self, task: str, now: float) -> bool:
        """Whether any teammate was heard on `task` within tau."""
        return any(self.is_on(contact, now) for contact in self.contacts(task))

    def heard_until(self, contact: Contact, instant: float) -> bool:
        """comm_received(i, k, j, 0, instant)."""
        return in_window(self._beginning(contact), -math.inf, instant, self._closed)

    def is_news(self, contact: Contact, before: float, now: float) -> bool:
        """comm_received in (before, now], and not in (0, before]: first heard since the last communication check.

        A message can come at the very instant of a check, but after it. So that it is counted once all the same, each
        check marks what it has counted (`note_checked`); the literal reading goes by instants alone and misses it.
        """
        if self._closed:
            return not contact.noticed
        return in_window(self._beginning(contact), before, now, closed=False)

    def note_checked(self) -> None:
        """All that was heard so far has been counted: it is no news to the next step."""
        for contacts in self._contacts.values():
            for contact in contacts.values():
                contact.noticed = True

    def _beginning(self, contact: Contact) -> float:
        return contact.since if self._per_attempt else contact.first

    def note_lapses(self, now: float) -> None:
        """Remember the instant at which each teammate ceases to be heard on a task."""
        for contacts in self._contacts.values():
            for contact in contacts.values():
                if contact.lapsed_at is None and not self.is_on(contact, now):
                    contact.lapsed_at = now
