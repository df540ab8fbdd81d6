"""Valid documents of any kind of message, drawn from what its fields say of themselves.

No kind is named here: one that is added to `BODY_OF` is sampled as it is declared. Values stand at the ends of what a field
allows more often than between them. Whoever declares a type or a rule between fields that cannot be met by chance is told.
"""

import re
from collections.abc import Iterable, Iterator
from random import Random
from types import UnionType
from typing import Annotated, Any, Literal, NamedTuple, Union, get_args, get_origin

import msgpack
from pydantic import BaseModel
from pydantic.fields import FieldInfo
from pydantic_core import PydanticUndefined

from lalliance_agents.errors import MessageError
from lalliance_agents.wire.keys import WORLD, Key, Keys, Kind
from lalliance_agents.wire.messages import BODY_OF, decode_at

KEYS = Keys("m")

#: How often chance is given to meet a rule between fields.
TRIES = 200

TEXTS = [
    "left", "right", "crate-1", "a", "x" * 40, "x" * 64, WORLD, "", "two words", "*", "**", "a/b", "1.0", "0",
    "\n\x1b[2J", "\0", "ß", "١٢", "\U000e0001" * 40, "\u202e", "😀" * 10,
]  # fmt: skip


class CannotSampleError(Exception):
    """A kind of message for which this module draws no valid document."""


class Valid(NamedTuple):
    """A document that is accepted on its key."""

    kind: Kind
    key: str
    document: dict[str, Any]
    payload: bytes


def valid(kind: Kind, draw: Random) -> Valid:
    """One valid message of `kind`, spoken by whoever may, on its key.

    Raises:
        CannotSampleError: chance finds none.
    """
    key = Key(kind, "left" if "{robot}" in kind.value else None, "crate-1" if "{task}" in kind.value else None)
    fault = None
    for _ in range(TRIES):
        document = _document(BODY_OF[kind], draw) | {"sender": key.speaker}
        if key.task is not None and "task" in document:
            document["task"] = key.task
        payload: bytes = msgpack.packb(document)
        try:
            decode_at(key, payload)
        except MessageError as error:
            fault = error
        else:
            return Valid(kind, KEYS.build(kind, robot="left", task="crate-1"), document, payload)
    raise CannotSampleError(f"{kind.name}: none of {TRIES} documents is valid ({fault}); teach {__name__} its rule")


def _document(kind: type[BaseModel], draw: Random) -> dict[str, Any]:
    """Something for each field of `kind`; now and then nothing for one that has a default."""
    fields = {}
    for name, field in kind.model_fields.items():
        if name == "v" or field.is_required() or draw.random() < 0.8:
            fields[name] = _value(field.annotation, field.metadata, draw)
    return fields


def _value(annotation: Any, metadata: Iterable[Any], draw: Random) -> Any:
    """A value of a type with limits."""
    limits = list(_flat(metadata))
    origin, arguments = get_origin(annotation), get_args(annotation)
    made: Any
    if origin is Annotated:
        made = _value(arguments[0], [*limits, *arguments[1:]], draw)
    elif origin in {Union, UnionType}:
        made = _value(draw.choice(arguments), limits, draw)
    elif origin is Literal:
        made = draw.choice(arguments)
    elif origin is list:
        made = [_value(arguments[0], [], draw) for _ in range(_size(limits, draw))]
    elif origin is dict:
        made = {_value(arguments[0], [], draw): _value(arguments[1], [], draw) for _ in range(_size(limits, draw))}
    elif isinstance(annotation, type) and issubclass(annotation, BaseModel):
        made = _document(annotation, draw)
    else:
        made = _scalar(annotation, limits, draw)
    return made


def _scalar(annotation: Any, limits: list[Any], draw: Random) -> Any:
    if annotation in {None, type(None)}:
        return None
    if annotation is bool:
        return draw.random() < 0.5
    if annotation is int:
        lowest, highest = _least(limits, -(2**63)), _most(limits, 2**64 - 1)
        return draw.choice([lowest, highest, draw.randint(lowest, highest), min(highest, max(lowest, 1))])
    if annotation is float:
        lowest, highest = _least(limits, -1e300), _most(limits, 1e300)
        return draw.choice([lowest, highest, draw.uniform(lowest, highest), min(highest, max(lowest, 0.5))])
    if annotation is str:
        return draw.choice(_texts(limits))
    raise CannotSampleError(f"no values are known of the type {annotation!r}; teach {__name__} the type")


def _flat(metadata: Iterable[Any]) -> Iterator[Any]:
    for each in metadata:
        if isinstance(each, FieldInfo):
            yield from each.metadata
        else:
            yield each


def _limit(limits: list[Any], name: str) -> Any:
    """The limit of that name, or None."""
    found = [getattr(each, name, None) for each in limits]
    return next((each for each in found if each not in {None, PydanticUndefined}), None)


def _least(limits: list[Any], otherwise: Any) -> Any:
    above = _limit(limits, "gt")
    if above is not None:
        return above + 1 if isinstance(otherwise, int) else above + 1e-9
    least = _limit(limits, "ge")
    return otherwise if least is None else least


def _most(limits: list[Any], otherwise: Any) -> Any:
    below = _limit(limits, "lt")
    if below is not None:
        return below - 1 if isinstance(otherwise, int) else below - 1e-9
    most = _limit(limits, "le")
    return otherwise if most is None else most


def _size(limits: list[Any], draw: Random) -> int:
    least = _limit(limits, "min_length") or 0
    most = _limit(limits, "max_length")
    return draw.randint(least, least + 3 if most is None else min(most, least + 3))


def _texts(limits: list[Any]) -> list[str]:
    """Those of `TEXTS` that a field allows."""
    least, most, pattern = (_limit(limits, name) for name in ("min_length", "max_length", "pattern"))
    fitting = [
        text
        for text in TEXTS
        if len(text) >= (least or 0)
        and (most is None or len(text) <= most)
        and (pattern is None or re.search(pattern, text))
    ]
    if not fitting:
        raise CannotSampleError(f"no text is known of {least} to {most} letters and {pattern}; teach {__name__} one")
    return fitting
