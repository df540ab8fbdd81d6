"""Every command that the README or a page shows is carried out by a test, and can be parsed.

Which test carries out which block stands in `support.documents`; here that is held against the pages and the tests.
"""

import ast
import re
import shlex
from collections.abc import Iterator
from functools import cache

import pytest
import typer
from support.documents import DONE_ALIKE, PAGES, ROOT, RUN_BY, shown
from typer.core import TyperGroup
from typer.exceptions import TyperException

from mission_control.cli import app

#: Programs in blocks of commands that others answer for: who.
OTHERS = {
    ".": "the shell",
    "cd": "the shell",
    "curl": "dashboard/test_site.py, which speaks HTTP itself",
    "docker": "tests/compose",
    "kubectl": "needs a cluster; control/test_kubernetes.py holds all objects to the schemas of its versions",
    "make": ".ci/run",
    "pip": "every run of CI begins with it; the extras are looked up below",
    "pytest": "the test that the block is registered with",
    "python": "the test that the block is registered with",
    "python3": "the Makefile",
}


def test_every_block_of_commands_has_a_test_and_every_entry_a_block() -> None:
    there = [(page, block.first) for page in PAGES for block in shown(page)]
    told = [(page, first) for table in (RUN_BY, DONE_ALIKE) for page, firsts in table.items() for first in firsts]
    assert sorted(there) == sorted(told), "support/documents.py says which test carries out which block"


def test_the_tests_are_there_and_ask_for_their_blocks() -> None:
    runners = {test for firsts in RUN_BY.values() for test in firsts.values()}
    for test in runners | {test for firsts in DONE_ALIKE.values() for test in firsts.values()}:
        file, _, name = test.partition("::")
        path = ROOT / file if (ROOT / file).exists() else ROOT / "tests" / file
        text = path.read_text()
        if name:
            functions = [
                one for one in ast.walk(ast.parse(text)) if isinstance(one, ast.FunctionDef | ast.AsyncFunctionDef)
            ]
            assert name in {one.name for one in functions}, test
        if test in runners:
            assert f'carried_out_by("{test}")' in text, f"{test} does not ask for what it is to carry out"


def lines() -> Iterator[tuple[str, str]]:
    """Every `lalliance …` of a page, in blocks and in the text, that is written out."""
    for page in PAGES:
        for block in shown(page):
            yield from ((page, line) for line in block.text.splitlines() if line.startswith("lalliance "))
        text = re.sub(r"^```.*?^```", "", (ROOT / page).read_text(), flags=re.DOTALL | re.MULTILINE)
        found = re.findall(r"`(lalliance [a-z][^`]*)`", text)
        yield from ((page, " ".join(line.split())) for line in found if not re.search(r"[…\[]", line))


@cache
def tool() -> TyperGroup:
    """The commands, which parse what they are given and do nothing."""
    return without_effect(typer.main.get_group(app))


def without_effect(group: TyperGroup) -> TyperGroup:
    """A group of commands that do nothing."""
    for command in group.commands.values():
        if isinstance(command, TyperGroup):
            without_effect(command)
        command.callback = None
    group.callback = None
    return group


def parse(line: str) -> None:
    """Raises what is wrong with a line, but for what it leaves out."""
    words = shlex.split(line.partition(" > ")[0], comments=True)[1:]
    try:
        tool().main(words, prog_name="lalliance", standalone_mode=False)
    except TyperException as error:
        if type(error).__name__ not in {"MissingParameter", "NoArgsIsHelpError"} and str(error) != "Missing command.":
            raise


@pytest.mark.parametrize(("page", "line"), sorted(set(lines())), ids=lambda word: str(word).replace("/", "-"))
def test_every_command_can_be_parsed(page: str, line: str) -> None:
    parse(line)


@pytest.mark.parametrize(
    "line", ["lalliance runs m.yaml", "lalliance run m.yaml --sped 4", "lalliance run m.yaml --speed x"]
)
def test_what_cannot_be_parsed_is_found(line: str) -> None:
    with pytest.raises(TyperException):
        parse(line)


def test_other_programs_are_answered_for() -> None:
    words = {
        line.split()[0]
        for page in PAGES
        for block in shown(page)
        for line in block.text.splitlines()
        if line and not line.startswith(("#", "lalliance "))
    }
    assert words == OTHERS.keys()


def test_every_extra_that_is_to_be_installed_is_one() -> None:
    extras = set(re.findall(r"^(\w+) = \[$", (ROOT / "pyproject.toml").read_text(), flags=re.MULTILINE))
    named = [
        extra
        for page in PAGES
        for listed in re.findall(r"pip install '[.\w]+\[([\w,]+)\]'", (ROOT / page).read_text())
        for extra in listed.split(",")
    ]
    assert named
    assert set(named) <= extras
