"""What is written down for those who run containers: YAML that a person can read, with the command that made it."""

import shlex
from collections.abc import Sequence
from typing import Any

import yaml

Document = dict[str, Any]

#: How a file begins that was made by a command.
MADE_BY = "# Made by: lalliance"


def as_text(words: Sequence[str], *documents: Document) -> str:
    """Documents as the text of one file.

    Args:
        words: what `lalliance` was told.
        documents: what the file holds.
    """
    texts = (yaml.dump(document, Dumper=_Dumper, sort_keys=False, width=120) for document in documents)
    return f"{MADE_BY} {shlex.join(words)}\n" + "---\n".join(texts)


class _Dumper(yaml.SafeDumper):
    """Writes what occurs twice twice: a person is to read it."""

    def ignore_aliases(self, data: Any) -> bool:
        """Make no anchors."""
        del data
        return True
