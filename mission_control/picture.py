"""What an operator knows of a running mission, put together from the messages on the bus. Pure.

Nothing is drawn here: `live` shows a picture on a terminal, `events` prints what it adds line by line.
"""

from collections import deque
from dataclasses import dataclass, field

from lalliance_agents.wire.messages import DecisionMade, Event, Message, Motivations, Scalars, Status

#: Events kept for showing.
KEPT_EVENTS = 200


@dataclass(slots=True)
class Picture:
    """The latest of everything."""

    status: Status | None = None
    lead: float = 0.0
    """How far the time since the trial began is ahead of the operator's own mission time, in seconds."""
    motivations: dict[str, Motivations] = field(default_factory=dict)
    faults: list[str] = field(default_factory=list)
    """Those in force."""
    events: deque[str] = field(default_factory=lambda: deque(maxlen=KEPT_EVENTS))

    def take(self, message: Message, now: float) -> str | None:
        """Put a message that came at `now` into the picture; the line it adds to the events, if any."""
        line = None
        match message:
            case Status():
                self.status = message
                self.lead = message.elapsed - now
            case Motivations():
                self.motivations[message.sender] = message
            case Event() if message.kind != "order":  # which follows from an event that is told
                self._note_fault(message)
                line = f"{message.elapsed:7.1f} s  {message.text}"
            case DecisionMade():
                line = f"{max(now + self.lead, 0.0):7.1f} s  {describe(message)}"
            case _:
                pass
        if line is not None:
            self.events.append(line)
        return line

    def _note_fault(self, event: Event) -> None:
        if event.kind == "trial":
            self.faults.clear()
        elif event.kind == "fault":
            _, begins, fault = event.text.partition("fault: ")
            if begins:
                self.faults.append(fault)
            elif (over := event.text.removeprefix("fault is over: ")) in self.faults:
                self.faults.remove(over)

    def working(self, task: str) -> list[str]:
        """The robots whose bodies work on `task`."""
        robots = self.status.robots if self.status else {}
        return [robot for robot, facts in robots.items() if facts.get("task") == task and facts.get("present")]

    def strongest(self, robot: str) -> tuple[str, Scalars] | None:
        """The task a robot is most motivated for, with the factors of that motivation."""
        sets = self.motivations[robot].sets if robot in self.motivations else {}
        ranked = sorted(sets.items(), key=lambda item: -_number(item[1].get("motivation")))
        return ranked[0] if ranked else None


def _number(value: object) -> float:
    return float(value) if isinstance(value, int | float) else 0.0


_REASONS = {
    "free": "nobody is on it",
    "silence": "{other} is not heard any more",
    "impatience": "patience with {other} has ended",
    "released": "{other} has left it",
    "contender": "to {other}, after {active:.1f} s",
    "collision": "to {other}, which started at the same time and goes first",
    "no_success": "no success after {active:.1f} s",
    "sensed": "it is complete",
    "inapplicable": "it does not apply just now",
    "body_failed": "its own code failed",
    "new_trial": "the next trial begins",
}


def describe(made: DecisionMade) -> str:
    """A decision as one line."""
    verbs = {
        "activate": "starts",
        "yield": "yields",
        "give_up": "gives up",
        "complete": "is finished with",
        "drop": "drops",
    }
    template = _REASONS.get(made.cause)
    reason = template.format(other=made.other, active=made.active_for) if template else made.cause
    return f"{made.sender} {verbs.get(made.verb, made.verb)} {made.task}: {reason}"


def printable(text: str, limit: int = 500) -> str:
    """`text` without what would change the terminal, cut to `limit` characters."""
    cut = text if len(text) <= limit else f"{text[:limit]} ..."
    return "".join(letter if letter.isprintable() or letter == "\t" else "?" for letter in cut)
