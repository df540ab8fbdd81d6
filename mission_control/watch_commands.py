"""`lalliance why`, `echo`, `hz` and `top`: look at a mission that runs, without taking part in it.

As everywhere, heavy imports are made where they are needed.
"""

from pathlib import Path
from typing import Annotated

import typer

from lalliance_agents.errors import UserError
from lalliance_agents.extras import extra
from mission_control.shell import AsJson, Connect, Keys, run_until_told, warn

Mission = Annotated[
    str | None,
    typer.Option(metavar="NAME", help="Which mission; default: the only one that runs.", show_default=False),
]
Pattern = Annotated[
    str,
    typer.Argument(
        metavar="KEY-PATTERN",
        help="Keys below the mission, such as heartbeat/lifter; * is one part of a key, ** any number of them.",
        show_default=False,
    ),
]


def why(
    robot: Annotated[
        str | None, typer.Argument(help="Whose decisions; default: all that happened.", show_default=False)
    ] = None,
    task: Annotated[str | None, typer.Argument(help="Decisions about this task alone.", show_default=False)] = None,
    begins: Annotated[
        str, typer.Option("--from", metavar="TIME", help="Leave out what was before: seconds of the trial, or 2:14.")
    ] = "0",
    ends: Annotated[
        str | None, typer.Option("--to", metavar="TIME", help="Leave out what was later.", show_default=False)
    ] = None,
    bag: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Look into a recording instead of a running mission.")
    ] = None,
    follow: Annotated[bool, typer.Option("--follow", help="Go on until the mission is over.")] = False,
    mission: Mission = None,
    connect: Connect = None,
    keys: Keys = None,
    as_json: AsJson = False,
) -> None:
    """Tell why robots decided what they did, a sentence each."""
    from mission_control.watch.why import Answer, from_recording, live
    from mission_control.watch.window import Window, instant

    window = Window(robot, task, instant(begins), float("inf") if ends is None else instant(ends))
    if window.ends < window.begins:
        raise UserError(f"--to {ends} is before --from {begins}; expected an instant after it")
    answer = Answer(window, as_json=as_json)
    if bag is None:
        run_until_told(live(mission, connect, keys, answer, follow=follow))
        return
    for name, given in (("--follow", follow), ("--mission", mission is not None)):
        if given:
            raise UserError(
                f"{name} is for a mission that runs, and --bag looks into a recording; expected one of the two"
            )
    with extra("record"):
        from mission_control.recording.reader import sightings
    from_recording(bag, sightings(bag, warn), answer)


def echo(
    pattern: Pattern,
    once: Annotated[bool, typer.Option("--once", help="End after the first message.")] = False,
    mission: Mission = None,
    connect: Connect = None,
    keys: Keys = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON document per message, a line each.")] = False,
) -> None:
    """Print messages as they come."""
    from mission_control.watch.echo import echo as print_messages

    run_until_told(print_messages(pattern, mission, connect, keys, once=once, as_json=as_json))


def hz(
    pattern: Pattern,
    window: Annotated[
        int, typer.Option(min=2, max=1_000_000, help="Messages of each key that are looked at.")
    ] = 10_000,
    seconds: Annotated[
        float | None,
        typer.Option("--for", min=0.1, max=1e6, metavar="SECONDS", help="End after so long and tell only then."),
    ] = None,
    mission: Mission = None,
    connect: Connect = None,
    keys: Keys = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON documents, a line each.")] = False,
) -> None:
    """Print how often messages come, of each key: in real seconds."""
    from mission_control.watch.hz import hz as print_rates

    run_until_told(print_rates(pattern, mission, connect, keys, window=window, seconds=seconds, as_json=as_json))


def top(
    once: Annotated[bool, typer.Option("--once", help="Print one table instead of a view that goes on.")] = False,
    mission: Mission = None,
    connect: Connect = None,
    keys: Keys = None,
    as_json: AsJson = False,
) -> None:
    """Show what every robot is doing, and how well it hears the others."""
    from mission_control.watch.top import top as show

    run_until_told(show(mission, connect, keys, once=once, as_json=as_json))
