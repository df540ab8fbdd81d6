"""What is kept of each mission: one row for each contender, in Parquet files that are there whole or not at all.

| column | meaning |
|---|---|
| `experiment`, `scenario` | which: the scenario as a number of the manifest's list |
| `mission`, `seed`, `contender` | the mission's number, the study's seed, and who |
| `kind`, `strategy`, `ordering`, `variant` | of the contender, see `contenders` |
| `makespan` | seconds; null if the mission was given up |
| `optimum`, `bound` | HRASP's: the best schedule known, and what is proven that none is shorter, in seconds |
| `proven` | whether these two are the same |
| `shared_optimum` | in seconds, where the scenario is `shared_max` or `shared_add` and work left belongs to the task |
| `ratio` | makespan / optimum |
| `reallocations` | tasks begun as a teammate was silent, too slow or gone; of a baseline: that a new plan moved |
| `activations`, `messages` | of the live trial; null for baselines; messages also where the simulator ran |
| `unfinished` | whether it was given up |

Optima are null where the experiment does not ask for them.
"""

from collections.abc import Iterable
from pathlib import Path

import polars as pl

from lalliance_agents.errors import UserError
from lalliance_agents.whole_file import written_whole
from lalliance_study.experiments.manifest import Manifest

SCHEMA = pl.Schema(
    {
        "experiment": pl.String,
        "scenario": pl.Int32,
        "mission": pl.Int32,
        "seed": pl.Int64,
        "contender": pl.String,
        "kind": pl.String,
        "strategy": pl.String,
        "ordering": pl.String,
        "variant": pl.String,
        "makespan": pl.Float64,
        "optimum": pl.Float64,
        "bound": pl.Float64,
        "proven": pl.Boolean,
        "shared_optimum": pl.Float64,
        "ratio": pl.Float64,
        "reallocations": pl.Int32,
        "activations": pl.Int32,
        "messages": pl.Int64,
        "unfinished": pl.Boolean,
    }
)
#: Rows lie in this order, whoever made which when.
ORDER = ("scenario", "contender", "mission")

FOLDER = "rows"
ENDING = ".parquet"


def path_of(out: Path, part: str) -> Path:
    """Where the rows of a part are kept."""
    return out / FOLDER / (part + ENDING)


def write(out: Path, part: str, found: pl.DataFrame) -> None:
    """Keep the rows of a part; a process that dies meanwhile leaves nothing that could be taken for them.

    Raises:
        UserError: they cannot be written.
    """
    path = path_of(out, part)
    try:
        with written_whole(path) as file:
            found.write_parquet(file)
    except OSError as error:
        raise UserError(f"{path}: {error.strerror}; the rows could not be written") from None


def kept(out: Path) -> set[str]:
    """The parts whose rows are there."""
    return {path.stem for path in (out / FOLDER).glob(f"*{ENDING}")}


def read(out: Path, experiments: Iterable[str] | None = None) -> pl.DataFrame:
    """All rows of a study, with the fields of their scenarios, in a fixed order.

    Args:
        out: the study's folder.
        experiments: only the rows of these; by default all.

    Raises:
        UserError: there is no study, or a file of it cannot be read.
    """
    manifest = Manifest.read(out)
    wanted = {one.name for one in manifest.experiments} if experiments is None else set(experiments)
    paths = sorted(path_of(out, part) for part in kept(out) if part.rsplit("-", 2)[0] in wanted)
    try:
        found = [pl.read_parquet(path, schema=SCHEMA) for path in paths]
    except (pl.exceptions.PolarsError, OSError) as error:
        raise UserError(f"{out}: rows that cannot be read ({error}); expected what lalliance study run wrote") from None
    rows = pl.concat(found) if found else SCHEMA.to_frame()
    return rows.sort(ORDER).join(scenarios(manifest), on="scenario", how="left", maintain_order="left")


def scenarios(manifest: Manifest) -> pl.DataFrame:
    """The scenarios of a study: `scenario`, its number, and a column for each field of `Scenario`."""
    return pl.DataFrame(
        [{"scenario": one.number, **one.scenario.model_dump(mode="json")} for one in manifest.scenarios],
        schema_overrides={"scenario": pl.Int32},
        infer_schema_length=None,
    )
