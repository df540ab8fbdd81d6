"""Tables in Markdown, and pages of which parts are made from figures.

In such a page a made part stands between `<!-- name -->` and `<!-- end -->`, each in a line of its own. Tests compare the
pages with what would be made, so that nothing in them is older than what it is made from.
"""

from collections.abc import Callable, Mapping, Sequence

Line = Sequence[str]
END = "<!-- end -->"


def table(head: Line, body: Sequence[Line], *, right: bool = False) -> str:
    """A table; its columns but the first are aligned to the right if they are numbers."""
    rule = ["---", *(["--:" if right else "---"] * (len(head) - 1))]
    return "".join(f"| {' | '.join(line)} |\n" for line in (head, rule, *body))


def renewed(page: str, parts: Mapping[str, Callable[[], str]]) -> str:
    """A page's text with those of the parts that stand in it made anew.

    Raises:
        ValueError: a part has a beginning and no end.
    """
    for name, made in parts.items():
        before, found, rest = page.partition(f"<!-- {name} -->\n")
        if found:
            _, end, after = rest.partition(END)
            if not end:
                raise ValueError(f"the part {name!r} has no {END}")
            page = before + found + made() + end + after
    return page
