"""Pieces that only the report has."""

from lalliance_study.report.statistics import Estimate


def number(estimate: Estimate | None, digits: int = 3) -> str:
    """A value and its interval, or a dash where there is none."""
    if estimate is None:
        return "–"
    value, low, high = (f"{part:.{digits}f}" for part in estimate)
    return value if low == "nan" else f"{value} ({low} to {high})"


def figure(name: str, caption: str) -> str:
    """A picture with what it shows."""
    return f"![{caption}]({name}.png)\n\n*{caption}*\n"


def folded(title: str, text: str) -> str:
    """What a reader opens only if it is wanted."""
    return f"<details>\n<summary>{title}</summary>\n\n{text}\n</details>\n"
