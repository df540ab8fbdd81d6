"""Key expressions: which text is a key, which is a pattern, and what a pattern matches. Pure.

A key is one or more chunks joined by `/`, a pattern is a key in which whole chunks may be `*` (exactly one chunk) or `**`
(any number of chunks, also none). A chunk that starts with `@` is matched only by the same chunk, never by a wildcard.
This is Zenoh's grammar but for its wildcards inside a chunk (`$*`), which are refused here. Patterns need not be in
Zenoh's canonical form. Checking happens before Zenoh sees a key, because one too long breaks a session for good.
"""

import re
from functools import lru_cache

#: Longest key or pattern that is accepted, in bytes of UTF-8.
MAX_KEY = 512

_CHUNK = r"[^/*$#?]+"
_KEY = re.compile(rf"{_CHUNK}(?:/{_CHUNK})*")
_PATTERN = re.compile(rf"(?:\*\*?|{_CHUNK})(?:/(?:\*\*?|{_CHUNK}))*")


def check_key(key: str) -> None:
    """Accept a key that can be published on.

    Raises:
        ValueError: if `key` is too long, holds a wildcard or a character that keys cannot hold, or has an empty chunk.
    """
    _check(key, _KEY, "key")


def check_pattern(pattern: str) -> None:
    """Accept a pattern that can be subscribed to, answered or asked.

    Raises:
        ValueError: if `pattern` is too long, has a wildcard inside a chunk, an illegal character or an empty chunk.
    """
    _check(pattern, _PATTERN, "pattern")


def _check(text: str, grammar: re.Pattern[str], kind: str) -> None:
    # Encoding raises UnicodeEncodeError, a ValueError, for what is not text at all (a lone surrogate).
    size = len(text.encode())
    if size > MAX_KEY:
        raise ValueError(f"a {kind} of {size} bytes: at most {MAX_KEY} are accepted; it starts with {text[:40]!r}")
    if not grammar.fullmatch(text):
        raise ValueError(f"{text!r} is not a {kind}: expected chunks joined by single slashes, without $, # and ?")


@lru_cache(maxsize=2**17)
def matches(pattern: str, key: str) -> bool:
    """Whether `pattern` matches `key`, which holds no wildcard."""
    return intersects(pattern, key)


def intersects(one: str, other: str) -> bool:
    """Whether some key is matched by both patterns.

    Row by row over the chunks of `one`: `reachable[j]` says whether the chunks of `one` so far and the first `j` chunks
    of `other` can stand for the same chunks. The work is bounded by the product of the two lengths.
    """
    if one == other:
        return True
    columns = other.split("/")
    reachable = _extend([True] + [False] * len(columns), None, columns)
    for chunk in one.split("/"):
        reachable = _extend(_advance(reachable, chunk, columns), chunk, columns)
    return reachable[-1]


def _advance(reachable: list[bool], chunk: str, columns: list[str]) -> list[bool]:
    """Match `chunk` with the next column, or with none where either side is a `**` that allows it."""
    nothing = chunk == "**"
    row = [nothing and reachable[0]]
    for j, column in enumerate(columns):
        alone = (nothing and reachable[j + 1]) or (column == "**" and reachable[j + 1] and not chunk.startswith("@"))
        row.append(alone or (reachable[j] and _meet(chunk, column)))
    return row


def _extend(row: list[bool], chunk: str | None, columns: list[str]) -> list[bool]:
    """Let a `**` just matched go on over further columns, and let a `**` of the columns match nothing."""
    for j, column in enumerate(columns):
        if row[j] and (column == "**" or (chunk == "**" and not column.startswith("@"))):
            row[j + 1] = True
    return row


def _meet(one: str, other: str) -> bool:
    if one == other:
        return True
    if one in ("*", "**"):
        return not other.startswith("@")
    return other in ("*", "**") and not one.startswith("@")
