"""Why a robot decided what it did: one sentence made from the factors that are logged with each decision. Pure.

A sentence says only what its message holds, so it is the same live, from a recording, and from the simulator. Messages come
over a bus: whatever is missing in one, or is no number, is left out of the sentence.
"""

import math
from collections.abc import Callable, Mapping
from typing import Any

from lalliance_agents.model.events import Cause, Pace
from lalliance_agents.wire.messages import DecisionMade
from mission_control.watch.happened import Happened
from mission_control.watch.words import reason_of

#: A number of a sentence is one of the message's to so many seconds; smaller differences are none.
_SLACK = 1e-6

_DONE = {
    Cause.FREE: "{me} started {task}",
    Cause.SILENCE: "{me} took {task}",
    Cause.IMPATIENCE: "{me} took {task}",
    Cause.RELEASED: "{me} took {task}",
    Cause.CONTENDER: "{me} yielded {task} to {other}",
    Cause.COLLISION: "{me} yielded {task} to {other}",
    Cause.NO_SUCCESS: "{me} gave up {task}",
    Cause.SENSED: "{me} finished {task}",
}


def tell(one: Happened) -> str:
    """Something that happened as one sentence: of a decision with its reasons."""
    return f"at {one.at:.1f} s: {one.text}" if one.made is None else explain(one.made, one.at)


def explain(made: DecisionMade, at: float) -> str:
    """A decision, made `at` seconds after the trial began, as one sentence: who did what when, and why."""
    try:
        cause = Cause(made.cause)
    except ValueError:
        return f"{made.sender} decided to {made.verb} {made.task} at {at:.1f} s: {made.cause}"
    facts = _Facts(made)
    done = _DONE.get(cause, "{me} dropped {task}").format(me=made.sender, task=made.task, other=made.other)
    reasons = [clause for clause in _REASONS[cause](facts) if clause]
    return f"{done} at {at:.1f} s: {'; '.join(reasons)}"


def plain(one: Happened) -> dict[str, Any]:
    """Something that happened, for programs: with its sentence, and with all factors of a decision."""
    words = ("at", "trial", "kind", "robot", "task", "cause", "other", "fault")
    behind = (
        {}
        if one.made is None
        else one.made.model_dump(
            include={"verb", "active_for", "grown_for", "expected", "factors", "teammates", "terms"}
        )
    )
    return {**{word: getattr(one, word) for word in words}, "sentence": tell(one), **behind}


class _Facts:
    """What a decision holds, with names and numbers checked."""

    def __init__(self, made: DecisionMade) -> None:
        self.made = made
        self.me = made.sender
        self.mine = f"{made.sender}'s"
        self.other = made.other or "a teammate"
        self._mate: Mapping[str, Any] = next((one for one in made.teammates if one.get("robot") == made.other), {})

    def factor(self, name: str) -> float | None:
        return _number(self.made.factors.get(name))

    def term(self, name: str) -> float | None:
        return _number(self.made.terms.get(name))

    def mate(self, name: str) -> float | None:
        """A number that was known of the other teammate."""
        return _number(self._mate.get(name))

    def since(self, name: str) -> float | None:
        """How long ago an instant was that was known of the other teammate, in seconds."""
        instant = self.mate(name)
        return None if instant is None else max(self.made.at - instant, 0.0)

    @property
    def learns(self) -> bool:
        return self.made.terms.get("architecture") != "alliance"

    @property
    def strategy(self) -> str:
        """By which strategy a time was chosen, as an aside."""
        word = self.made.terms.get("strategy")
        return f", strategy {word}" if word in {"I", "II", "III"} else ""

    @property
    def spent(self) -> str:
        return f"{self.made.active_for:.1f} s"


def _number(value: object) -> float | None:
    """`value` if it is a finite number."""
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        return None
    return float(value)


def _aside(template: str, value: float | None) -> str:
    """A remark in brackets, if its number is known."""
    return "" if value is None else f" ({template.format(value)})"


def _taken(occasion: Callable[[_Facts], str]) -> Callable[[_Facts], list[str]]:
    return lambda facts: [occasion(facts), _competence(facts), _boredom(facts), _motivation(facts)]


def _free(facts: _Facts) -> str:
    del facts
    return "nobody had been heard on it"


def _silence(facts: _Facts) -> str:
    silent = facts.mate("silent_for")
    tau = _aside("tau {:.1f} s", facts.term("silence_timeout"))
    return (
        f"{facts.other} not heard any more{tau}" if silent is None else f"{facts.other} silent for {silent:.1f} s{tau}"
    )


def _impatience(facts: _Facts) -> str:
    patience, on_it = facts.mate("patience"), facts.since("started")
    while_on_it = "" if on_it is None else f", which had been on it for {on_it:.1f} s,"
    if patience is None:
        return f"patience with {facts.other}{while_on_it} had ended"
    whose = (
        f"{facts.other}'s time as {facts.me} knows it" if facts.strategy.endswith(" III") else f"{facts.mine} own time"
    )
    aside = f"{whose}{facts.strategy}" if facts.learns else "set by hand"
    return f"patience with {facts.other}{while_on_it} had ended after {patience:.1f} s ({aside})"


def _released(facts: _Facts) -> str:
    ago = facts.since("last_heard")
    when = "any more" if ago is None else f"for {ago:.1f} s"
    return (
        f"{facts.other} had left it: heard, but not on it {when}{_aside('tau {:.1f} s', facts.term('silence_timeout'))}"
    )


def _competence(facts: _Facts) -> str:
    """How well the robot expects to do the task, compared with those present."""
    if not facts.learns:
        return ""
    own, best = facts.factor("own_time"), facts.factor("best_time")
    if own is None:
        return f"{facts.me} did not know its own time yet"
    told = f"{facts.mine} own time {own:.1f} s"
    if best is None:
        return told
    if best >= own - _SLACK:
        return f"{told} was the best of those present"
    return f"{told}, where the best of those present was {best:.1f} s"


def _boredom(facts: _Facts) -> str:
    """Why the robot did not leave the task to others: only where that was a question."""
    bored, threshold = facts.factor("boredom"), facts.term("boredom_threshold")
    if not facts.learns or facts.factor("category") != 2 or facts.made.factors.get("pace") == Pace.RANDOM:
        return ""
    if bored is None or threshold is None or bored < threshold - _SLACK:
        return ""
    return f"it was bored enough to take what is not its own first choice (boredom {bored:.1f} of {threshold:.1f})"


def _motivation(facts: _Facts) -> str:
    pace, grown = facts.made.factors.get("pace"), facts.made.grown_for
    if pace == Pace.RANDOM:
        return "its motivation grows by chance in the active learning phase"
    if pace not in {Pace.FAST, Pace.SLOW}:
        return "its motivation had reached the threshold"
    told = f"motivation reached the threshold after {grown:.1f} s"
    value, rate = facts.factor("motivation"), facts.factor("rate")
    if value is None or rate is None:
        return told
    steadily = abs(value - rate * grown) <= _SLACK * max(value, 1.0)
    return f"{told} at the {pace} rate" if steadily else f"{told}, the last of it at the {pace} rate"


def _contender(facts: _Facts) -> list[str]:
    psi, ago = facts.factor("psi"), facts.since("last_heard")
    whose = "the best time of those present" if facts.strategy == ", strategy II" else f"{facts.mine} own time"
    aside = f"{whose}{facts.strategy}" if facts.learns else "set by hand"
    limit = "" if psi is None else f", longer than psi {psi:.1f} s ({aside})"
    heard = "" if ago is None else f"{facts.other} was heard on it {ago:.1f} s before"
    return [f"{facts.me} had been on it for {facts.spent}{limit}", heard]


def _collision(facts: _Facts) -> list[str]:
    ago, theirs, own = facts.since("started"), facts.mate("expected"), facts.made.expected
    window = _aside("a collision is up to {:.1f} s", facts.term("collision_window"))
    apart = "at the same time" if ago is None else f"within {abs(ago - facts.made.active_for):.1f} s of each other"
    if theirs is None:
        first = f"{facts.other} goes first"
    elif abs(theirs - own) <= _SLACK:
        first = f"both expected {own:.1f} s, and {facts.other} comes first by name"
    else:
        first = f"{facts.other} expected {theirs:.1f} s and {facts.me} {own:.1f} s"
    return [f"both had started it {apart}{window}", first]


def _no_success(facts: _Facts) -> list[str]:
    limit, own, factor = facts.factor("lambda"), facts.factor("own_time"), facts.term("give_up_factor")
    if not facts.learns:
        aside = " (set by hand)"
    else:
        aside = "" if own is None or factor is None else f" ({factor:g} times its own time {own:.1f} s)"
    longer = "" if limit is None else f", longer than lambda {limit:.1f} s{aside}"
    return [f"no success after {facts.spent} on it{longer}"]


def _sensed(facts: _Facts) -> list[str]:
    expected = _aside("{:.1f} s expected", facts.made.expected or None)
    return [f"it is complete, after {facts.spent} on it{expected}"]


def _not_best(facts: _Facts) -> list[str]:
    return ["a teammate was expected to do it better (influence_on_active read literally)", _competence(facts)]


_REASONS: dict[Cause, Callable[[_Facts], list[str]]] = {
    Cause.FREE: _taken(_free),
    Cause.SILENCE: _taken(_silence),
    Cause.IMPATIENCE: _taken(_impatience),
    Cause.RELEASED: _taken(_released),
    Cause.CONTENDER: _contender,
    Cause.COLLISION: _collision,
    Cause.NO_SUCCESS: _no_success,
    Cause.SENSED: _sensed,
    Cause.INAPPLICABLE: lambda facts: [f"{reason_of(facts.made)}, after {facts.spent} on it"],
    Cause.BODY_FAILED: lambda facts: [f"{reason_of(facts.made)}, after {facts.spent} on it"],
    Cause.NEW_TRIAL: lambda facts: [reason_of(facts.made)],
    Cause.RESET: lambda facts: [f"{facts.other} was first heard on it (reset_on_active read literally)"],
    Cause.NOT_BEST: _not_best,
    Cause.SUPPRESSED: lambda facts: [f"another task of {facts.me} was active (one_active read literally)"],
}


def unmoved(robot: str, task: str, factors: Mapping[str, Any], unworkable: str) -> str:
    """Why `robot` is not on `task` just now, from the factors of its motivation for it.

    Args:
        robot: its name.
        task: the same.
        factors: as the robot said them.
        unworkable: what the task is where sensory feedback says that it does not apply.
    """
    return f"{robot} is not on {task} now: {'; '.join(_obstacles(factors, unworkable))}"


def _obstacles(factors: Mapping[str, Any], unworkable: str) -> list[str]:
    if factors.get("sensory_feedback") == 0:
        return [f"the task {unworkable}"]
    own, best = _number(factors.get("own_time")), _number(factors.get("best_time"))
    compared = (
        "" if own is None or best is None else f" (its own time {own:.1f} s, the best of those present {best:.1f} s)"
    )
    zero = {
        "activity_suppression": "it is on another task",
        "impatience_reset": "a teammate has just been heard on it",
        "learned_robot_influence": f"it leaves the task to others until it is bored{compared}",
    }
    found = [words for name, words in zero.items() if factors.get(name) == 0]
    if found:
        return found
    held: dict[str, str] = {
        Pace.SLOW: "a teammate is on it, so its motivation grows at the slow rate",
        Pace.WAITING: "it waits for its teammates to be heard first",
    }
    told = held.get(str(factors.get("pace")), "its motivation grows")
    motivation = _number(factors.get("motivation"))
    return [told if motivation is None else f"{told} and is at {motivation:.2f}"]
