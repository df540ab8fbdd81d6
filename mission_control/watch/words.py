"""Decisions and other things on a bus in words that can be printed. Pure."""

from lalliance_agents.wire.messages import DecisionMade

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
    return f"{made.sender} {verbs.get(made.verb, made.verb)} {made.task}: {reason_of(made)}"


def reason_of(made: DecisionMade) -> str:
    """Its cause in a few words."""
    template = _REASONS.get(made.cause)
    return template.format(other=made.other, active=made.active_for) if template else made.cause


def printable(text: str, limit: int = 500) -> str:
    """`text` without what would change the terminal, cut to `limit` characters."""
    cut = text if len(text) <= limit else f"{text[:limit]} ..."
    return "".join(letter if letter.isprintable() or letter == "\t" else "?" for letter in cut)
