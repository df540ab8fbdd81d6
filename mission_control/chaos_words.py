"""A fault as words of a command line. Pure.

Each word is FIELD=VALUE: a field of a fault in a mission file and its value, spelled as there. Dots lead into a field's own
fields; the ends of a link need no `link.` before them, two numbers are the shortest and the longest delay, and a glob stands
without the quotes that YAML asks for:

    kind=hang robot=lifter for=5
    from='*' to=pusher loss=0.3 delay='[0.05, 0.4]'        link: {from: "*", to: pusher}, delay: {uniform: [0.05, 0.4]}
    partition='[[a, b], [c]]' for=3

An injected fault begins now; `for` says how many seconds it lasts.
"""

import json
import re
from collections.abc import Iterable
from dataclasses import dataclass
from math import inf
from typing import Any

from lalliance_agents.config import Mission
from lalliance_agents.errors import UserError
from lalliance_agents.fault_checks import misfit
from lalliance_agents.mission_errors import one_line, short
from lalliance_agents.mission_file import read_fault, read_value
from lalliance_agents.wire.messages import LONGEST, LONGEST_FAULT

_BEGINS_NOW = "an injected fault begins now; expected for=SECONDS for how long it lasts"
_SHORT = {end: f"link.{end}" for end in ("from", "to", "both")}
_GLOB = re.compile(r"[A-Za-z0-9_*?-]*[*?][A-Za-z0-9_*?-]*")


@dataclass(frozen=True, slots=True)
class Injection:
    """A fault to inject.

    Attributes:
        fault: as JSON in the fields of a mission file.
        lasts: how long, in seconds; None: as long as the fault itself says.
    """

    fault: str
    lasts: float | None


def read_injection(words: Iterable[str], mission: Mission) -> Injection:
    """The fault that `words` spell, checked against the mission as far as that can be done beforehand.

    Raises:
        UserError: they spell no fault, or one that does not fit the mission.
    """
    content: dict[str, Any] = {}
    for word in words:
        field, value = _read(word)
        _put(content, _SHORT.get(field, field).split("."), value, word)
    lasts = content.pop("for", None)
    if not content.keys() & {"kind", "link", "partition"}:
        raise UserError(
            "no word says what is to fail; expected kind= and robot=, from= and to=, or partition=, "
            "as in kind=hang robot=NAME for=5"
        )
    if isinstance(delay := content.get("delay"), list):
        content["delay"] = {"uniform": delay}
    return read_content(content, lasts, mission)


def read_content(content: dict[str, Any], lasts: Any, mission: Mission) -> Injection:
    """A fault as plain data in the fields of a mission file, checked like one in words.

    Args:
        content: the fault.
        lasts: how long, in seconds; None: as long as the fault itself says.
        mission: the mission.

    Raises:
        UserError: it is no fault, or one that does not fit the mission.
    """
    for field in ("at", "until"):
        if field in content:
            raise UserError(f"{field}: {_BEGINS_NOW}")
    length = None if lasts is None else _length(lasts)
    return Injection(_checked(content, mission), length)


def _read(word: str) -> tuple[str, Any]:
    field, equals, text = word.partition("=")
    if not equals or not re.fullmatch(r"\w+(\.\w+)*", field):
        raise UserError(one_line(f"{short(word)!r} is not FIELD=VALUE; expected words like kind=hang"))
    if field in {"at", "until"}:
        raise UserError(f"{field}: {_BEGINS_NOW}")
    if _GLOB.fullmatch(text):
        return field, text
    try:
        return field, read_value(text)
    except UserError as error:
        hint = '; a glob inside a list needs quotes, as in [[a], ["b*"]]' if "alias" in str(error) else ""
        raise UserError(one_line(f"{field}: {error}{hint}")) from None


def _put(content: dict[str, Any], path: list[str], value: Any, word: str) -> None:
    twice = UserError(one_line(f"{short(word)!r} is about a field that has a value already; expected it once"))
    for field in path[:-1]:
        inner: Any = content.setdefault(field, {})
        if not isinstance(inner, dict):
            raise twice
        content = inner
    if path[-1] in content:
        raise twice
    content[path[-1]] = value


def _length(value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not 0 < value < inf:
        raise UserError(
            one_line(f"for: {short(str(value))} is not allowed; expected a number greater than 0, in seconds")
        )
    if value > LONGEST:
        raise UserError(f"for: {short(str(value))} is not allowed; expected a number of at most {LONGEST:g}")
    return float(value)


def _checked(content: dict[str, Any], mission: Mission) -> str:
    text = json.dumps(content)
    fault = read_fault(text)
    # Whether a robot that joins late is there by now, and what else is in force, only the world knows.
    wrong = misfit(fault, mission.robots, lambda robot: mission.robots[robot].tasks)
    if wrong is not None:
        raise UserError(f"{'.'.join(map(str, wrong[0]))}: {wrong[1]}")
    if len(text) > LONGEST_FAULT:
        raise UserError(f"the fault has {len(text)} letters; expected at most {LONGEST_FAULT}")
    return text
