"""Cases for the decoder: a key and a payload, valid, mutated or by chance, drawn without end from one seed.

A valid message of some kind is changed as a document, as bytes or in its key, and mostly in one place only, so that it comes
as far as the last checks. A few cases are as large as a payload may be: these look for what is slow or takes much memory.
"""

from collections.abc import Callable
from random import Random
from typing import Any, NamedTuple

import msgpack

from lalliance_agents.wire.keys import WORLD, Kind
from lalliance_agents.wire.messages import BODY_OF, MAX_PAYLOAD

from .samples import KEYS, TEXTS, Valid, valid

#: Valid messages of each kind from which the cases are made.
POOL = 100

NAN, INFINITY = float("nan"), float("inf")

#: What may stand where something else belongs.
ODD: list[Any] = [
    None, True, False, 0, 1, -1, 2, 2**31, 2**63 - 1, 2**63, 2**64 - 1, -(2**63), 0.0, -0.0, 1.0, 1.5, -1e-9, 1e13, 5e-324,
    NAN, INFINITY, -INFINITY, *TEXTS, "1", "nan", "x" * 501, "x" * 10_000, b"", b"left", b"\xff", [], [1], [[[[]]]], {},
    {"": {}}, {"a": 1}, {"\U000e0001" * 100: []}, {b"a": 1}, [None, True, "a"], msgpack.ExtType(5, b""),
    msgpack.ExtType(127, b"x" * 9), msgpack.Timestamp(0, 0), msgpack.Timestamp(2**33, 999),
]  # fmt: skip

#: Packed keys and values which a Python map cannot hold, or no packer makes.
RAW = [
    b"\x90", b"\x91\x90", b"\x80", b"\x81\xa1a\x80", b"\x01", b"\xff", b"\xc0", b"\xc3", b"\xc1", b"\xcb\x7f\xf8" + bytes(6),
    b"\xca\x7f\x80\0\0", b"\xcf" + b"\xff" * 8, b"\xd3\x80" + bytes(7), b"\xc4\x01v", b"\xa1\xff", b"\xa3\xed\xa0\x80",
    b"\xa1v", b"\xa6sender", b"\xa0", b"\xd4\xff\0", b"\xd6\xff\0\0\0\0", b"\xd7\xff" + b"\xff" * 8,
    b"\xc7\x0c\xff" + b"\xff" * 12, b"\xc7\0\x80", b"\xd9\x01a", b"\xda\0\x01a",
    b"\xdb\0\0\0\x01a", b"\xdc\0\0", b"\xdd\0\0\0\0", b"\xde\0\0", b"\xdf\0\0\0\0",
]  # fmt: skip

#: The heads of lists, maps, texts, bytes and extensions, with the bytes in which each tells its length.
HEADS = [
    (b"\xdc", 2), (b"\xdd", 4), (b"\xde", 2), (b"\xdf", 4), (b"\xd9", 1), (b"\xda", 2), (b"\xdb", 4), (b"\xc4", 1),
    (b"\xc5", 2), (b"\xc6", 4), (b"\xc7", 1), (b"\xc8", 2), (b"\xc9", 4),
]  # fmt: skip
NESTING = [
    b"\x91", b"\x92", b"\x81", b"\x81\xa1a", b"\xdc\0\x01", b"\xdc\xff\xff", b"\xdd\0\x01\xff\0", b"\xdf\0\0\xff\xff",
]  # fmt: skip
KEY_PIECES = [
    "/", "*", "**", "@", "\0", "\n", " ", "\ud800", "\U000e0001" * 90, "{robot}", "..", "x" * 65, "x" * 9000,
]  # fmt: skip


class Case(NamedTuple):
    """What arrives."""

    key: str
    payload: bytes


class Cases:
    """An endless number of cases.

    Args:
        draw: where all chance comes from.
    """

    def __init__(self, draw: Random) -> None:
        self._draw = draw
        self._pool = [valid(kind, draw) for kind in BODY_OF for _ in range(POOL)]

    def next(self) -> Case:
        """One more."""
        draw = self._draw
        chosen = draw.choice(self._pool)
        key = self._key(chosen.kind) if draw.random() < 0.15 else chosen.key
        chance = draw.random()
        if chance < 0.05:
            return Case(key, draw.randbytes(draw.randrange(100)))
        if chance < 0.1:
            return Case(key, chosen.payload)
        if chance < 0.102:
            return Case(key, draw.choice([_swollen, _nested, _oversize])(chosen, draw))
        if chance < 0.6:
            return Case(key, _as_document(chosen, draw))
        payload = chosen.payload if chance < 0.95 else _as_document(chosen, draw)
        for _ in range(draw.choice([1, 1, 1, 2, 3])):
            payload = draw.choice(_ON_BYTES)(payload, draw, draw.choice(self._pool).payload)
        return Case(key, payload)

    def _key(self, kind: Kind) -> str:
        """A key of another, or none at all."""
        draw = self._draw
        key = KEYS.build(
            draw.choice([kind, *Kind]), robot=draw.choice(["left", "right"]), task=draw.choice(["crate-1", "b"])
        )
        if draw.random() < 0.3:
            return key
        pieces = draw.choice([key, *TEXTS]).split("/")
        for _ in range(draw.randint(1, 3)):
            at = draw.randrange(len(pieces) + 1)
            pieces[at : at + draw.randint(0, 1)] = draw.choice([[], [draw.choice(KEY_PIECES)], pieces[:at], [key]])
        return "/".join(pieces)


def _as_document(chosen: Valid, draw: Random) -> bytes:
    """A valid message with some of its fields changed, moved, left out or added."""
    document: dict[Any, Any] = dict(chosen.document)
    name = draw.choice(list(document))
    match draw.randrange(8):
        case 0:
            del document[name]
        case 1:
            document[draw.choice(list(document))] = document[name]
        case 2:
            document[draw.choice([*TEXTS, b"v", 1, None, 2.5])] = draw.choice(ODD)
        case 3:
            return _with_raw(document, draw)
        case 4:
            packed: bytes = msgpack.packb(draw.choice([draw.choice(ODD), [document], list(document)]))
            return packed
        case 5:
            document |= {draw.choice(["sender", "task", "v"]): draw.choice(["left", "right", "b", WORLD, 2])}
        case _:
            document = _altered(document, draw)
    payload: bytes = msgpack.packb(document)
    return payload


def _altered(node: Any, draw: Random) -> Any:
    """A copy with one value replaced, at any depth."""
    if isinstance(node, dict) and node and draw.random() < 0.9:
        name = draw.choice(list(node))
        return {**node, name: _altered(node[name], draw)}
    if isinstance(node, list) and node and draw.random() < 0.9:
        return [*node[:-1], _altered(node[-1], draw)]
    return draw.choice(ODD)


def _with_raw(document: dict[Any, Any], draw: Random) -> bytes:
    """The packed document with one more entry, first or last, whose key and value can be just anything."""
    head: bytes = msgpack.Packer().pack_map_header(len(document) + 1)
    body: bytes = b"".join(msgpack.packb(name) + msgpack.packb(value) for name, value in document.items())
    entry = draw.choice(RAW) + draw.choice([draw.choice(RAW), _head(draw), draw.choice(NESTING) * 30])
    return b"".join([head, entry, body] if draw.random() < 0.5 else [head, body, entry])


def _head(draw: Random) -> bytes:
    """A head that claims a length: huge, or such that it might just fit."""
    head, size = draw.choice(HEADS)
    length = draw.choice([(1 << 8 * size) - 1, 1 << 8 * size - 1, 17, draw.randrange(256)])
    return head + length.to_bytes(size)


def _cut(payload: bytes, draw: Random) -> tuple[bytes, bytes, bytes]:
    """A payload in three, its middle short."""
    at = draw.randrange(len(payload) + 1)
    end = at + draw.randint(1, 12)
    return payload[:at], payload[at:end], payload[end:]


def _flip(payload: bytes, draw: Random, _: bytes) -> bytes:
    before, middle, after = _cut(payload, draw)
    return before + bytes(each ^ 1 << draw.randrange(8) for each in middle[:1]) + middle[1:] + after


def _insert(payload: bytes, draw: Random, _: bytes) -> bytes:
    before, middle, after = _cut(payload, draw)
    return before + draw.choice([draw.randbytes(draw.randint(1, 4)), _head(draw), draw.choice(RAW)]) + middle + after


def _overwrite(payload: bytes, draw: Random, _: bytes) -> bytes:
    before, middle, after = _cut(payload, draw)
    return before + draw.choice([draw.randbytes(len(middle)), _head(draw), draw.choice(RAW)]) + after


def _delete(payload: bytes, draw: Random, _: bytes) -> bytes:
    before, _middle, after = _cut(payload, draw)
    return before + after


def _truncate(payload: bytes, draw: Random, _: bytes) -> bytes:
    return payload[: draw.randrange(len(payload) + 1)]


def _double(payload: bytes, draw: Random, _: bytes) -> bytes:
    before, middle, after = _cut(payload, draw)
    return before + middle * draw.randint(2, 50) + after


def _nest(payload: bytes, draw: Random, _: bytes) -> bytes:
    before, middle, after = _cut(payload, draw)
    return before + draw.choice(NESTING) * draw.choice([2, 30, 600, 1030]) + middle + after


def _splice(payload: bytes, draw: Random, other: bytes) -> bytes:
    return payload[: draw.randrange(len(payload) + 1)] + other[draw.randrange(len(other) + 1) :]


_ON_BYTES: list[Callable[[bytes, Random, bytes], bytes]] = [
    _flip, _flip, _flip, _insert, _overwrite, _delete, _truncate, _double, _nest, _splice,
]  # fmt: skip


def _swollen(chosen: Valid, draw: Random) -> bytes:
    """A valid message in which one field holds as much as fits, mostly of what is wrong."""
    item = draw.choice([draw.choice(ODD), {"": []}, {"": 1}, 1, "a", "*"])
    each = len(msgpack.packb(item))
    room = MAX_PAYLOAD - len(chosen.payload) - 100
    key = draw.choice(["{:05x}", "{:05x}/", "\n{:05x}"])
    many = draw.choice([[item] * (room // each), {key.format(number): item for number in range(room // (each + 8))}])
    listed = [name for name, value in chosen.document.items() if isinstance(value, list | dict)]
    name = draw.choice(listed or list(chosen.document))
    payload: bytes = msgpack.packb({**chosen.document, name: draw.choice([many, many, [many], {"a": many}])})
    return payload


def _nested(chosen: Valid, draw: Random) -> bytes:
    """As many lists or maps in one another as are read, in a payload as large as any may be."""
    heads = draw.choice([*NESTING, _head(draw)]) * draw.choice([30, 1000, 1020, 20_000])
    return (draw.choice([b"", b"\x82\xa1v", chosen.payload]) + heads).ljust(
        MAX_PAYLOAD, draw.choice([b"\xc0", b"\x90", b"\xc1"])
    )


def _oversize(chosen: Valid, draw: Random) -> bytes:
    return chosen.payload.ljust(MAX_PAYLOAD + draw.randint(0, 2), b"\0")
