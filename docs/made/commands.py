"""The reference of the commands, from what `--help` knows of them."""

import re
from collections.abc import Iterator

import typer
from typer.core import TyperCommand, TyperGroup

from lalliance_study.markdown import table
from made.records import plain
from mission_control.cli import app

#: What for -> command -> the page that tells more of it.
GROUPS: dict[str, dict[str, str]] = {
    "run a mission": {
        "run": "missions.md",
        "simulate": "missions.md",
        "check": "missions.md",
        "schema": "missions.md",
    },
    "look at it": {
        "why": "watching.md",
        "top": "watching.md",
        "echo": "watching.md",
        "hz": "watching.md",
        "dashboard": "dashboard.md",
    },
    "disturb it": {"chaos": "faults.md", "campaign": "campaign.md"},
    "record it": {"record": "recording.md", "replay": "recording.md", "bag": "recording.md"},
    "deploy it": {
        "router": "deployment.md",
        "world": "deployment.md",
        "robot": "deployment.md",
        "health": "deployment.md",
        "summary": "deployment.md",
        "keys": "security.md",
        "deploy": "deployment.md",
    },
    "study the method": {"study": "study/README.md"},
}

#: What those pages are called.
TITLES = {
    "missions.md": "missions",
    "faults.md": "faults",
    "watching.md": "watching a mission",
    "dashboard.md": "the web page",
    "campaign.md": "campaigns",
    "recording.md": "recordings",
    "deployment.md": "deployments",
    "security.md": "security",
    "study/README.md": "the study",
}

#: What `--help` says of a value's kind -> what it is called here.
KINDS = {"float": "X", "float range": "X", "int": "N", "int range": "N", "str": "TEXT", "list[str]": "", "path": "PATH"}

_BOUNDS = re.compile(r"(?P<least>[\d.]+)<=?x(<=?(?P<most>[\d.]+))?|x>=?(?P<only>[\d.]+)")
#: Bounds of this size say nothing to a reader.
_HUGE = re.compile(r"x<=\d{9,}")


Command = TyperCommand | TyperGroup


def tool() -> dict[str, Command]:
    """The commands by name."""
    return within(typer.main.get_group(app))


def within(command: Command) -> dict[str, Command]:
    """The commands of a group by name; of a single command, none."""
    inner = command.commands if isinstance(command, TyperGroup) else {}
    return {name: one for name, one in inner.items() if isinstance(one, Command)}


def overview(folder: str) -> str:
    """A table of all commands by what they are for: a line each.

    Args:
        folder: the way to the pages, from the page that it stands in.

    Raises:
        ValueError: a command is in no group or in two, or a group names what is no command.
    """
    grouped = [name for group in GROUPS.values() for name in group]
    if sorted(grouped) != sorted(tool()):
        raise ValueError(f"commands are {sorted(tool())}, grouped are {sorted(grouped)}")
    rows = [
        (
            purpose,
            ", ".join(f"[`lalliance {name}`]({folder}commands.md#{name})" for name in group),
            ", ".join(f"[{TITLES[page]}]({folder}{page})" for page in dict.fromkeys(group.values())),
        )
        for purpose, group in GROUPS.items()
    ]
    return table(("to", "command", "more"), rows)


def reference() -> str:
    """Each command with its arguments and options."""
    commands = tool()
    parts = []
    for purpose, group in GROUPS.items():
        parts.append(f"## {purpose.capitalize()}\n")
        for name, page in group.items():
            command = commands[name]
            parts.append(f"### {name}\n\n{_usage(command, name)}\nMore: [{TITLES[page]}]({page}).\n")
            parts.extend(f"#### {name} {sub}\n\n{_usage(one, f'{name} {sub}')}" for sub, one in within(command).items())
    return "\n" + "\n".join(parts)


def _usage(command: Command, name: str) -> str:
    """What a command does, and its arguments and options, each told once."""
    paragraphs = [" ".join(part.split()) for part in (command.help or "").split("\n\n")]
    rows = list(_parameters(command, name))
    return "\n\n".join([*paragraphs, table(("argument or option", "meaning", "default"), rows) if rows else ""])


def _parameters(command: Command, name: str) -> Iterator[tuple[str, str, str]]:
    """The rows of a command's table: how it is spelled, what it means, and what holds without it."""
    context = typer.Context(command, info_name=name)
    for parameter in command.get_params(context):
        record = parameter.get_help_record(context)
        if record is not None and parameter.name != "help":
            yield _row(*record)


def _row(spelled: str, told: str) -> tuple[str, str, str]:
    """What `--help` says of one argument or option, in three cells."""
    meaning, _, noted = told.partition("  [")
    meaning, _, follows = meaning.partition("; default: ")
    default, more = follows.rstrip("."), []
    for note in noted.removesuffix("]").split("; "):
        if note == "required":
            default = "*required*"
        elif note.startswith("default: "):
            default = f"`{note.removeprefix('default: ')}`"
        elif note.startswith("env var: "):
            more.append(f"or the variable `{note.removeprefix('env var: ')}`")
        elif _BOUNDS.fullmatch(note) and not _HUGE.search(note):
            more.append(_range(note))
    return f"`{_spelling(spelled)}`", f"{'; '.join([meaning.rstrip('.'), *more])}.", default


def _spelling(text: str) -> str:
    """How an argument or option is written: with a word for its value that says its kind."""
    if not text.startswith("-"):
        return re.sub(r" <[^>]*>$", "", text).upper()
    return re.sub(r"<([^>]*)>", lambda found: KINDS.get(found[1], found[1].replace("|", " or ")), text)


def _range(bounds: str) -> str:
    """`0.1<=x<=9.0` or `x>=1` in words."""
    found = _BOUNDS.fullmatch(bounds)
    if found is None or not found["most"]:
        return f"{plain(float(bounds.strip('x<>=')))} or more"
    return f"{plain(float(found['least']))} to {plain(float(found['most']))}"
