"""What stands in the README."""

import re
import shlex

from support.processes import MISSIONS

README = (MISSIONS.parent / "README.md").read_text()


def blocks(language: str) -> list[str]:
    """All blocks of code in a language."""
    return re.findall(rf"^```{language}\n(.*?)^```", README, flags=re.DOTALL | re.MULTILINE)


def commands(block: str) -> list[list[str]]:
    """The arguments of each `lalliance` in a block."""
    return [shlex.split(line)[1:] for line in block.splitlines() if line.startswith("lalliance ")]
