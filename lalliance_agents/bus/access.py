"""Who may say what on an encrypted bus: the rules that a router enforces, in its own words.

Whatever no rule allows is denied, and nothing tells the sender so. A rule names message kinds and key expressions that must
hold all of a message's key, and is bound to certificates by their common names. Everybody who has a certificate may listen
to everything below `lalliance/`; each may speak only on its own keys, in whatever mission. What follows from the rules, and
what they cannot do, stands in `docs/security.md`.
"""

from collections.abc import Iterable, Iterator
from typing import Any

from lalliance_agents.bus.credentials import ROUTER
from lalliance_agents.wire.keys import OF_ROBOT, OF_WORLD, OPERATOR, ROOT, WORLD, Keys, Kind

Rule = dict[str, Any]

_ANY_MISSION = Keys("*")
#: All keys of all missions; what begins with `@` is matched only by name.
_EVERYTHING = [f"{ROOT}/**", f"{ROOT}/*/@chaos/**"]
#: Presences of processes: nothing is published there.
_PRESENCES = (Kind.ALIVE, Kind.LAUNCHER)
#: Last values and past events, which their owners also answer queries with.
_ANSWERED = (Kind.HELLO, Kind.SENSE_TASK, Kind.SENSE_ROBOT, Kind.CHAOS_RULES, Kind.EVENT)
#: What the world remembers for others, in their own messages.
_REMEMBERED = (Kind.DECISION,)
#: An operator who launches a mission also holds its processes.
_OF_OPERATOR = (Kind.CHAOS_DEED, Kind.LAUNCHER)


def access_control(robots: Iterable[str]) -> dict[str, Any]:
    """The router's rules for a team.

    Args:
        robots: the names of all its robots.
    """
    own = {name: list(_speaking(name, OF_ROBOT)) for name in robots}
    own[WORLD] = [
        *_speaking(WORLD, OF_WORLD),
        _answer(f"{WORLD} remembers", _REMEMBERED),
        _answer(f"{WORLD} carries out", [Kind.CHAOS_COMMAND]),
    ]
    own[OPERATOR] = [
        *_speaking(OPERATOR, _OF_OPERATOR),
        _rule(f"{OPERATOR} commands", ["query"], _keys([Kind.CHAOS_COMMAND])),
    ]
    everybody = [*_listening(), _egress()]
    routers = _rule("routers pass on", _SPOKEN + _HEARD, _EVERYTHING)
    return {
        "enabled": True,
        "default_permission": "deny",
        "rules": [*everybody, routers, *(rule for rules in own.values() for rule in rules)],
        "subjects": [{"id": name, "cert_common_names": [name]} for name in [*own, ROUTER]],
        "policies": [
            {"rules": [rule["id"] for rule in everybody], "subjects": [*own, ROUTER]},
            {"rules": [routers["id"]], "subjects": [ROUTER]},
            *({"rules": [rule["id"] for rule in rules], "subjects": [name]} for name, rules in own.items()),
        ],
    }


_SPOKEN = ["put", "query", "declare_queryable", "reply", "liveliness_token"]
_HEARD = ["declare_subscriber", "declare_liveliness_subscriber", "liveliness_query"]


def _speaking(name: str, kinds: Iterable[Kind]) -> Iterator[Rule]:
    """What `name` may say of `kinds`, on the keys that are its own."""
    kinds = tuple(kinds)
    robot = "*" if name.startswith("@") else name
    said = [kind for kind in kinds if kind not in _PRESENCES]
    yield _rule(f"{name} says", ["put"], _keys(said, robot))
    if present := [kind for kind in kinds if kind in _PRESENCES]:
        yield _rule(f"{name} is there", ["liveliness_token"], _keys(present, robot))
    if answered := [kind for kind in kinds if kind in _ANSWERED]:
        yield _answer(f"{name} answers", answered, robot)


def _answer(name: str, kinds: Iterable[Kind], robot: str = "*") -> Rule:
    return _rule(name, ["declare_queryable", "reply"], _keys(kinds, robot))


def _listening() -> Iterator[Rule]:
    yield _rule("everybody listens", _HEARD, _EVERYTHING)
    yield _rule("everybody asks", ["query"], _keys((*_ANSWERED, *_REMEMBERED)))


def _egress() -> Rule:
    """What a router hands out, to whoever it let in."""
    return _rule("everybody hears", _SPOKEN + _HEARD, _EVERYTHING, flow="egress")


def _keys(kinds: Iterable[Kind], robot: str = "*") -> list[str]:
    return [_ANY_MISSION.build(kind, robot=robot) for kind in kinds]


def _rule(name: str, messages: list[str], keys: list[str], *, flow: str = "ingress") -> Rule:
    return {"id": name, "permission": "allow", "messages": messages, "flows": [flow], "key_exprs": keys}
