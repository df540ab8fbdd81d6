"""Tables of the fields of records, from what the records say themselves: names, allowed values, units, defaults, meanings.

The unit of a number stands in its description, as everywhere in the code ("in seconds", "per second"). A number without one is
an error here if it is not listed as having none, and so is a field without a description.
"""

import json
import re
from collections.abc import Callable
from enum import IntEnum
from typing import Any

from pydantic.fields import FieldInfo
from pydantic_core import to_jsonable_python

from lalliance_agents.config import ENVIRONMENT_PATTERN, FACTORY_PATTERN
from lalliance_agents.faults import GLOB_PATTERN
from lalliance_agents.model.parameters import LARGEST, Record, Strategy
from lalliance_agents.wire.keys import NAME_PATTERN
from lalliance_study.markdown import table

#: Where records are told of that others hold.
RECORDS = {
    "EnvironmentChoice": "see [environment](missions.md#environment)",
    "TaskSpec": "see [tasks](missions.md#tasks)",
    "RobotSpec": "see [robots](missions.md#robots)",
    "Parameters": "see [parameters](parameters.md)",
    "HandSet": "see [by hand](parameters.md#by-hand)",
    "Phase": "see [phases](missions.md#phases)",
    "Link": "see [links](missions.md#links)",
    "Bursts": "see [losses](missions.md#losses)",
    "UniformDelay": "see [delays](missions.md#delays)",
    "LogNormalDelay": "see [delays](missions.md#delays)",
    "LogNormal": "see [delays](missions.md#delays)",
    "Erratum": "the name of an [erratum](model.md#errata)",
} | dict.fromkeys(
    ("Crash", "Hang", "Stuck", "Slow", "RadioFault", "Blind", "LinkFault", "Partition"),
    "see [faults](missions.md#faults)",
)

HEAD = ("field", "allowed", "unit", "default", "meaning")

#: What a description says of a number -> its unit; the first that is found is taken.
UNITS = {
    r"in motivation per second": "motivation/s",
    r"in messages per second": "messages/s",
    r"per second": "1/s",
    r"in motivation\b": "motivation",
    r"in seconds|many seconds": "s",
    r"in attempts": "attempts",
}

#: Numbers without a unit: counts, shares, factors, and what is drawn from.
WITHOUT_UNIT = {
    "Bursts.bad", "Bursts.enter", "Bursts.good", "Bursts.leave", "LinkFault.duplicate", "LinkFault.loss", "LinkFault.reorder",
    "LogNormal.sigma", "Mission.seed", "Options.noise", "Options.slack", "Parameters.boredom_threshold",
    "Parameters.failure_factor", "Parameters.give_up_factor", "Phase.trials", "Slow.factor",
}  # fmt: skip

GREEK = {
    "theta": "θ", "rho": "ρ", "tau": "τ", "mu": "μ", "phi": "φ", "psi": "ψ", "lambda": "λ",
    "delta_slow": "δ_slow", "delta_fast": "δ_fast",
}  # fmt: skip

PATTERNS = {
    NAME_PATTERN: "a name",
    GLOB_PATTERN: "a name or glob",
    FACTORY_PATTERN: "`module:factory`",
    ENVIRONMENT_PATTERN: "a word or `module:Class`",
}


def fields(record: type[Record]) -> str:
    """A table of the fields of a record, in its order."""
    return table(HEAD, [row(record, name) for name in record.model_fields])


def row(record: type[Record], name: str) -> tuple[str, ...]:
    """What there is to say of one field of a record, after `HEAD`."""
    field = record.model_fields[name]
    schema = record.model_json_schema(mode="validation")
    spelled = field.alias or name
    return _row(f"{record.__name__}.{name}", spelled, field, schema["properties"][spelled], schema.get("$defs", {}))


def _row(place: str, name: str, field: FieldInfo, schema: dict[str, Any], defs: dict[str, Any]) -> tuple[str, ...]:
    if field.description is None:
        raise ValueError(f"{place} says nothing of what it means")
    meaning, _, follows = field.description.replace("\n", " ").partition("; default: ")
    rest = ""
    if follows:
        follows, dot, rest = follows.partition(". ")
        rest = f" {rest}" if dot else ""
    told = allowed(schema, defs)
    unit = unit_of(place, field.description) if "number" in told else ""
    return (
        f"`{name}`",
        told,
        unit,
        f"{follows.rstrip('.')}" if follows else default(field),
        greek(f"{meaning.rstrip('.')}.{rest}").replace("|", "\\|"),
    )


def unit_of(place: str, description: str) -> str:
    """The unit of the number at `place`, which its description names.

    Raises:
        ValueError: it names none, or one where there should be none.
    """
    said = description.replace("\n", " ")
    unit = next((unit for pattern, unit in UNITS.items() if re.search(pattern, said)), None)
    if (unit is None) is not (place in WITHOUT_UNIT):
        raise ValueError(f"{place} says {'nothing of its unit' if unit is None else f'{unit} and has no unit'}: {said}")
    return unit or "–"


def greek(text: str) -> str:
    """A text with Greek letters in the place of their names."""
    names = "|".join(sorted(GREEK, key=len, reverse=True))
    return re.sub(rf"(?<![A-Za-z_])({names})(?![A-Za-z])", lambda name: GREEK[name[0]], text)


def default(field: FieldInfo) -> str:
    """What holds where a field is not given."""
    if field.is_required():
        return "*required*"
    match field.get_default(call_default_factory=True, validated_data={}):
        case Record():
            said = "all defaults"
        case (Record(), *_):
            said = "one with all defaults"
        case None | () | {}:
            said = "none"
        case float(number):
            said = f"`{number:g}`"
        case value:
            said = f"`{_spelled(value)}`"
    return said


def _spelled(value: object) -> str:
    """A default as a mission file has it."""
    if isinstance(value, IntEnum):
        return value.name if isinstance(value, Strategy) else value.name.lower()
    return json.dumps(to_jsonable_python(value)).strip('"')


def allowed(schema: dict[str, Any], defs: dict[str, Any]) -> str:
    """The values that a field takes, in words."""
    match schema:
        case {"$ref": reference}:
            name = reference.removeprefix("#/$defs/")
            said = RECORDS.get(name) or allowed(defs[name], defs)
        case {"anyOf": alternatives} | {"oneOf": alternatives}:
            told = [allowed(one, defs) for one in alternatives if one.get("type") != "null"]
            said = " or ".join(dict.fromkeys(told))
        case {"const": only}:
            said = f"`{only}`"
        case {"enum": words}:
            said = ", ".join(f"`{one}`" for one in words)
        case {"type": kind}:
            said = KINDS[kind](schema, defs)
        case _:
            said = "anything"
    return said


def _number(schema: dict[str, Any], _: object) -> str:
    return _bounded("number", schema)


def _whole_number(schema: dict[str, Any], _: object) -> str:
    return _bounded("whole number", schema)


def _bounded(kind: str, schema: dict[str, Any]) -> str:
    bounds = (
        ("exclusiveMinimum", ">"),
        ("minimum", "≥"),
        ("exclusiveMaximum", "<"),
        ("maximum", "≤"),
    )
    said = [
        f"{sign} {plain(schema[bound])}" for bound, sign in bounds if bound in schema and not schema[bound] >= LARGEST
    ]
    return " ".join([kind, ", ".join(said)]).strip()


def plain(number: float) -> str:
    """A number as people write it."""
    return f"{number:,.0f}" if number >= 1000 else f"{number:g}"


def _list(schema: dict[str, Any], defs: dict[str, Any]) -> str:
    if "prefixItems" in schema:
        return f"[{', '.join(allowed(one, defs) for one in schema['prefixItems'])}]"
    inner = allowed(schema["items"], defs)
    return f"list: {inner}"


def _mapping(schema: dict[str, Any], defs: dict[str, Any]) -> str:
    values = [*schema.get("patternProperties", {}).values(), schema.get("additionalProperties")]
    keys = schema.get("propertyNames")
    key = "a name" if keys is None else allowed(keys, defs)
    return f"map: {key} → {allowed(values[0], defs) if isinstance(values[0], dict) else 'anything'}"


#: A type of JSON -> its values in words.
KINDS: dict[str, Callable[[dict[str, Any], dict[str, Any]], str]] = {
    "number": _number,
    "integer": _whole_number,
    "boolean": lambda _, __: "`true`, `false`",
    "string": lambda schema, _: PATTERNS.get(schema.get("pattern", ""), "text"),
    "array": _list,
    "object": _mapping,
}
