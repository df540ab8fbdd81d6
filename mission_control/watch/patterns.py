"""Which keys somebody wants to look at, as written on the command line. Pure."""

from lalliance_agents.bus.patterns import check_pattern, intersects
from lalliance_agents.errors import UserError
from lalliance_agents.suggestions import like
from lalliance_agents.wire.keys import ROOT, Keys, Kind


def whole_pattern(text: str, mission: str) -> str:
    """A pattern as it is written on the command line, below the mission or whole, as one of whole keys.

    Raises:
        UserError: it is none, or no message can ever come on such a key.
    """
    keys, below = Keys(mission), text.removeprefix("/")
    pattern = below if below.startswith(f"{ROOT}/") else keys.prefix + below
    try:
        check_pattern(pattern)
    except ValueError:
        raise UserError(
            f"{text[:80]!r} is not a pattern of keys; expected chunks joined by single slashes, of which * is any one and "
            "** any number"
        ) from None
    if not any(intersects(pattern, keys.build(kind)) for kind in Kind if kind is not Kind.CHAOS_COMMAND):
        forms = sorted({kind.format(task="*", robot="*") for kind in Kind})
        hint = like(below, forms) or f"; expected one such as {', '.join(forms[2:6])} or **"
        raise UserError(f"{text[:80]!r} matches no key of mission {mission}{hint}")
    return pattern
