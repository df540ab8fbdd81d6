"""What was probably meant by a word that names nothing."""

from collections.abc import Iterable
from difflib import get_close_matches

#: Names that a sentence lists before it only counts.
FEW = 8


def like(word: str, known: Iterable[str]) -> str:
    """`; did you mean …?` if one of `known` is spelled much like `word`, else nothing."""
    close = get_close_matches(word, known, n=1, cutoff=0.6)
    return f"; did you mean {close[0]!r}?" if close else ""


def like_or_any(word: str, known: Iterable[str]) -> str:
    """The same, and if none is spelled like that, which there are: `; expected one of …`, the first few of them."""
    names = list(known)
    more = f" and {len(names) - FEW} more" if len(names) > FEW else ""
    return like(word, names) or (f"; expected one of {', '.join(names[:FEW])}{more}" if names else "")
