"""What pydantic found wrong with a mission, told in the words of the mission file.

A finding is a line, a place (fields, names and indices from the top of the file) and a sentence: what is wrong with which
value, and what was expected. Pydantic names the kind of error, a place in its own terms and the limits that were broken;
here these become a place that exists in the file (the alternative of a union is no part of it) and the value as it is
written there. Kinds of errors that are not known here keep pydantic's message.
"""

import re
from collections.abc import Iterable, Iterator, Mapping
from itertools import combinations
from typing import Any, NamedTuple, get_args, get_origin

from pydantic import BaseModel, Tag
from pydantic_core import ErrorDetails

from lalliance_agents.config import ENVIRONMENT_PATTERN, FACTORY_PATTERN
from lalliance_agents.faults import GLOB_PATTERN, LinkFault, Partition
from lalliance_agents.model.parameters import Parameters
from lalliance_agents.suggestions import like
from lalliance_agents.wire.keys import NAME_PATTERN

Place = tuple[str | int, ...]
"""Fields, names and indices from the top of the file down to a value."""

_KINDS = {bool: "a truth value", int: "a number", float: "a number", str: "text", list: "a list", dict: "a mapping"}
_PATTERNS = {
    NAME_PATTERN: ("is not a name", "1 to 64 of A-Z a-z 0-9 _ -"),
    GLOB_PATTERN: ("is no name and no glob", "1 to 64 of A-Z a-z 0-9 _ - * ?"),
    FACTORY_PATTERN: ("is not allowed", "package.module:factory"),
    ENVIRONMENT_PATTERN: ("is not allowed", "the name of an environment or package.module:Class"),
}
#: What was expected, by pydantic's kind of error; braces name fields of the error's context.
_EXPECTED = {
    "greater_than": "a number greater than {gt}",
    "greater_than_equal": "a number of at least {ge}",
    "less_than": "a number less than {lt}",
    "less_than_equal": "a number of at most {le}",
    "finite_number": "a finite number",
    "float_type": "a number",
    "float_parsing": "a number",
    "int_type": "a whole number",
    "int_parsing": "a whole number",
    "int_from_float": "a whole number",
    "bool_type": "true or false",
    "bool_parsing": "true or false",
    "string_type": "text",
    "dict_type": "a mapping",
    "model_type": "a mapping",
    "model_attributes_type": "a mapping",
    "list_type": "a list",
    "tuple_type": "a list",
    "too_short": "{min_length} or more entries",
    "too_long": "{max_length} or fewer entries",
    "string_too_short": "text of at least {min_length} characters",
    "string_too_long": "text of at most {max_length} characters",
}

#: What is taken for the kind of a fault, and is one of the fields that stand in its place.
_WITHOUT_KIND = LinkFault.model_fields.keys() | Partition.model_fields.keys()
#: How the kinds of errors end that say: this is another kind of value.
_OF_KIND = ("_type", "_parsing")


class Spot(NamedTuple):
    """Where a value stands in the file and how it is written there."""

    line: int
    value: Any
    text: str = ""


class Finding(NamedTuple):
    """One thing that is wrong with a mission file."""

    line: int
    place: Place
    sentence: str


class _Told(NamedTuple):
    """An error in words, still with the alternatives of unions that it is about, the outermost first."""

    place: Place
    depth: int
    alternatives: tuple[Place, ...]
    wrong: str
    hint: str
    missing: str = ""
    """The field that is missing."""
    meant: Place = ()
    """The place that an unknown field was probably to have."""
    key: Place = ()
    """The place whose key, not whose value, is wrong."""

    @property
    def sentence(self) -> str:
        return f"{self.wrong}; {self.hint}" if self.hint else self.wrong


def explain(
    errors: Iterable[ErrorDetails], record: type[BaseModel], spots: Mapping[Place, Spot], prefix: Place = ()
) -> list[Finding]:
    """What is wrong, as findings.

    Args:
        errors: pydantic's, from making a `record` of the values at `prefix`.
        record: the record, whose fields are suggested for an unknown one.
        spots: every value of the file by its place; the top is always among them.
        prefix: where the record's values stand.
    """
    found: list[Finding] = []
    told_all: list[_Told] = []
    for error in errors:
        context = error.get("ctx", {})
        if error["type"] == "misplaced":
            place = (*prefix, *context["path"])
            nested = explain(context.get("errors", ()), Parameters, spots, place)
            found += nested or [Finding(line_of(place, spots), place, context["message"])]
        elif told := _tell(error, record, spots, prefix):
            told_all.append(told)
    told_all = _of_likeliest(told_all)
    misspelled = {told.meant for told in told_all if told.meant}
    return found + [
        Finding(line_of(told.key or told.place, spots), told.place, told.sentence)
        for told in told_all
        if (*told.place, told.missing) not in misspelled
    ]


def line_of(place: Place, spots: Mapping[Place, Spot]) -> int:
    """The line of a place, or of what surrounds it where the file says nothing there."""
    while place not in spots:
        place = place[:-1]
    return spots[place].line


def show(spot: Spot) -> str:
    """A value as a sentence quotes it: text in quotes, the rest as in the file, cut to about 60 characters."""
    shown = spot.text if type(spot.value) in (bool, int, float) else repr(spot.value)
    return short(shown or repr(spot.value))


def short(text: str) -> str:
    """`text`, cut to about 60 characters."""
    return text if len(text) <= 60 else f"{text[:56]} ..."


def dotted(place: Place) -> str:
    """A place as a sentence names it, with quotes around what is not plainly a name."""
    return ".".join(str(part) if re.fullmatch(r"[\w-]+", str(part)) else short(repr(part)) for part in place)


def one_line(text: str) -> str:
    """`text` without what would break its line or hide in it."""
    return "".join(letter if letter.isprintable() else repr(letter)[1:-1] for letter in text)


def kind_of(value: object) -> str:
    """What a person calls a value of this type."""
    return "nothing" if value is None else _KINDS.get(type(value), "something else")


def _of_likeliest(told_all: Iterable[_Told], level: int = 0) -> list[_Told]:
    """What remains when each union, from the `level`-th around a value on inwards, is taken as one of its alternatives."""
    left: list[_Told] = []
    unions: dict[Place, dict[Place, list[_Told]]] = {}
    for told in told_all:
        if len(told.alternatives) <= level:
            left.append(told)
        else:
            alternative = told.alternatives[level]
            unions.setdefault(alternative[:-1], {}).setdefault(alternative, []).append(told)
    for alternatives in unions.values():
        left += _likeliest([_of_likeliest(inner, level + 1) for inner in alternatives.values()])
    return left


def _likeliest(alternatives: list[list[_Told]]) -> list[_Told]:
    """Of the alternatives of a union the one that fits best: its errors lie deepest. Where no kind fits, all in one."""
    if len(alternatives) == 1:
        return alternatives[0]
    firsts = [told[0] for told in alternatives]
    if all(told.place == firsts[0].place and told.depth == len(told.place) and not told.meant for told in firsts):
        # What ends with the value as it was probably meant comes last.
        hints = sorted(
            (told.hint.removeprefix("expected ") for told in firsts if told.hint), key=lambda hint: "," in hint
        )
        wanted = dict.fromkeys(hints)
        return [firsts[0]._replace(hint=f"expected {' or '.join(wanted)}" if wanted else "")]
    return max(alternatives, key=lambda told: (max(one.depth for one in told), -len(told)))


def _tell(error: ErrorDetails, record: type[BaseModel], spots: Mapping[Place, Spot], prefix: Place) -> _Told | None:
    """One error in words; None if it only follows from another one."""
    kind, context, loc = error["type"], dict(error.get("ctx", {})), (*prefix, *error["loc"])
    of_key, absent = loc[-1:] == ("[key]",), kind == "missing"
    place, dropped = _place(loc[:-1] if of_key or absent else loc, len(prefix), spots)
    spot = spots.get(place, Spot(0, error["input"]))
    depth, alternatives = len(place), tuple(loc[: index + 1] for index in dropped)
    if absent or kind == "union_tag_not_found":
        return _missing(loc[-1] if absent else context["discriminator"].strip("'"), place, alternatives)
    if kind == "extra_forbidden":
        return _unknown(place, _fields(record, place[len(prefix) : -1], loc), alternatives)
    if kind == "too_short" and len(spot.value) >= context["min_length"]:
        return None
    if kind == "union_tag_invalid":
        place = (*place, context["discriminator"].strip("'"))
        spot = spots.get(place, Spot(0, context["tag"]))
    key: Place = ()
    if of_key:
        spot, key, place = Spot(spot.line, place[-1]), place, place[:-1]
    if not kind.endswith(_OF_KIND):
        depth += 1
    return _Told(place, depth, alternatives, *_judge(kind, context, spot, error["msg"]), key=key)


def _missing(field: str | int, place: Place, alternatives: tuple[Place, ...]) -> _Told:
    if isinstance(field, int):
        return _Told(
            place, len(place) + 1, alternatives, "an entry is missing", f"expected {field + 1} or more entries"
        )
    hint = f"expected a field {field!r}"
    return _Told(place, len(place) + 1, alternatives, "a field is missing", hint, missing=field)


def _unknown(place: Place, known: list[str], alternatives: tuple[Place, ...]) -> _Told:
    hint = like(str(place[-1]), known).removeprefix("; ")
    meant = (*place[:-1], hint.removeprefix("did you mean ").strip("'?")) if hint else ()
    return _Told(place, len(place), alternatives, "unknown field", hint or f"expected {_one_of(known)}", meant=meant)


def _judge(kind: str, context: dict[str, Any], spot: Spot, message: str) -> tuple[str, str]:
    """What is wrong with a value, and what was expected."""
    wrong = f"{show(spot)} is not allowed"
    if kind in ("value_error", "assertion_error"):
        reason = str(context["error"])
        options = reason.removeprefix("expected one of ").split(", ")
        return (wrong, reason + like(str(spot.value), options)) if reason.startswith("expected ") else (reason, "")
    if options := re.findall(r"'([^']*)'", str(context.get("expected", context.get("expected_tags", "")))):
        aside = f"; {spot.value} is a field without a kind" if str(spot.value) in _WITHOUT_KIND else ""
        return wrong, f"expected {_one_of(options)}{aside or like(str(spot.value), options)}"
    if kind == "string_pattern_mismatch":
        fault, wanted = _PATTERNS.get(context["pattern"], ("is not allowed", f"text that matches {context['pattern']}"))
        colon = ", and a space after a colon" if context["pattern"] == NAME_PATTERN and ":" in str(spot.value) else ""
        return f"{show(spot)} {fault}", f"expected {wanted}{colon}"
    if kind in _EXPECTED:
        limits = {name: f"{limit:.15g}" if isinstance(limit, float) else limit for name, limit in context.items()}
        return _compare(kind, _EXPECTED[kind].format_map(limits), spot)
    return f"{wrong}: {message[:1].lower()}{message[1:]}", ""


def _compare(kind: str, wanted: str, spot: Spot) -> tuple[str, str]:
    """What is wrong with a value where another kind of value, or one within limits, was expected."""
    given, wrong = kind_of(spot.value), f"{show(spot)} is not allowed"
    if spot.value is None:
        wrong = "nothing is given"
    elif kind.endswith(_OF_KIND) and (given, wanted) != ("a number", "a whole number"):
        wrong = f"{show(spot)} is {given}"
        wanted += _remedy(wanted, spot)
    return wrong, f"expected {wanted}"


def _remedy(wanted: str, spot: Spot) -> str:
    """How a value of the wrong kind is probably meant, if that can be seen."""
    if wanted == "text" and spot.text:
        return f", in quotes: '{short(spot.text)}'"
    if wanted == "a list" and isinstance(spot.value, str):
        return f", as in [{short(spot.value)}]"
    if wanted == "a mapping" and isinstance(spot.value, list) and spot.value and isinstance(spot.value[0], str):
        return f", as in {{{short(spot.value[0])}: ...}}"
    number = re.fullmatch(r"[-+]?\d+(\.\d*)?( *[a-zA-Z%]+)?", spot.value) if isinstance(spot.value, str) else None
    if "number" in wanted and number is not None:
        return " without a unit" if number[2] else " without quotes"
    return ""


def _one_of(options: Iterable[str]) -> str:
    listed = list(options)
    return listed[0] if len(listed) == 1 else f"one of {', '.join(listed)}"


def _place(loc: Place, fixed: int, spots: Mapping[Place, Spot]) -> tuple[Place, tuple[int, ...]]:
    """The place in the file that pydantic means by `loc`, and the indices of the parts that the file does not have.

    Pydantic counts the alternative of a union as a part of the place: up to two such parts are left out. The first
    `fixed` parts are no alternatives.
    """
    for number in range(3):
        for left_out in combinations(range(fixed, len(loc)), number):
            place = tuple(part for index, part in enumerate(loc) if index not in left_out)
            if place in spots:
                return place, left_out
    return loc, ()


def _fields(record: type[BaseModel], place: Place, loc: Place) -> list[str]:
    """The fields that a mapping at `place` of a `record` can have, in the alternative of unions that `loc` names."""
    found = _records(record, place, loc)
    return list(dict.fromkeys(field.alias or name for one in found for name, field in one.model_fields.items()))


def _records(kind: Any, place: Place, loc: Place) -> Iterator[type[BaseModel]]:
    """The records that a value at `place` of a `kind` can be."""
    if any(isinstance(mark, Tag) and mark.tag not in loc for mark in getattr(kind, "__metadata__", ())):
        return
    if isinstance(kind, type) and issubclass(kind, BaseModel):
        if not place and _is_named(kind, loc):
            yield kind
        for name, field in kind.model_fields.items() if place else ():
            if (field.alias or name) == place[0]:
                yield from _records(field.annotation, place[1:], loc)
    elif get_origin(kind) not in (dict, list, tuple):
        for part in get_args(kind):
            yield from _records(part, place, loc)
    elif place:
        for part in get_args(kind):
            yield from _records(part, place[1:], loc)


def _is_named(record: type[BaseModel], loc: Place) -> bool:
    """Whether `loc` names the record by its kind, if it has one that is fixed."""
    kinds = get_args(record.model_fields["kind"].annotation) if "kind" in record.model_fields else ()
    return not kinds or any(kind in loc for kind in kinds)
