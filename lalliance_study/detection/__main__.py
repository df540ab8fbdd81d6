"""`python -m lalliance_study.detection run --out DIR [--quick]` measures, and `... draw --rows DIR --out DIR` draws."""

import argparse
import sys
from pathlib import Path

from lalliance_agents.errors import UserError
from lalliance_study.detection import plan

ROWS = Path("docs/faults/rows")


def _refused(error: UserError) -> int:
    sys.stderr.write(f"Error: {error}\n")
    return 2


def main() -> None:
    """Do what the command line says."""
    commands = argparse.ArgumentParser(prog="python -m lalliance_study.detection", description=__doc__)
    chosen = commands.add_subparsers(dest="command", required=True)
    run = chosen.add_parser("run", help="measure in the simulator, on all cores, and write rows")
    run.add_argument("--out", type=Path, default=ROWS, help="folder for the rows")
    run.add_argument("--quick", action="store_true", help="little of everything, to see that it works")
    run.add_argument("--seed", type=int, default=1, help="where all that is drawn comes from")
    run.add_argument("--only", choices=plan.KINDS, help="renew the rows of one kind beside others of the same seed")
    run.add_argument("--jobs", type=int, help="processes; default: one per core")
    draw = chosen.add_parser("draw", help="draw figures and write tables from rows, and from nothing else")
    draw.add_argument("--rows", type=Path, default=ROWS, help="folder of the rows")
    draw.add_argument("--out", type=Path, default=Path("docs/faults"), help="folder for the figures")
    draw.add_argument("--page", type=Path, help="a page whose tables are to be renewed")
    arguments = commands.parse_args()
    if arguments.command == "run":
        effort = {"quick": arguments.quick, "seed": arguments.seed, "jobs": arguments.jobs}
        try:
            done = plan.run(arguments.out, **effort, only=arguments.only)
        except UserError as error:
            sys.exit(_refused(error))
        sys.stderr.write(f"{done['parts']} parts in {done['seconds']} s; rows are in {arguments.out}\n")
        return
    from lalliance_study.detection import figures, tables  # noqa: PLC0415 - measuring needs no matplotlib

    for path in figures.draw(arguments.rows, arguments.out):
        sys.stderr.write(f"{path}\n")
    if arguments.page is not None:
        tables.renew(arguments.page, arguments.rows)


if __name__ == "__main__":
    main()
