"""Which function is which equation of the Appendix, and which tests hold it; the errata, and what each costs.

An equation is told from its function's docstring, which names it in the paper's words. Tests of a function of `equations`
are those that call it; of what the mind is made of, they are named here. Costs are read from the study's report.
"""

import ast
import inspect
import re
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator
from functools import cache
from pathlib import Path
from typing import Any

from lalliance_agents.model import appraisal, equations, hearing, mind, motivation
from lalliance_agents.model.parameters import Erratum, Reading
from lalliance_study.markdown import table
from made.records import greek

ROOT = Path(__file__).parents[2]
TESTS = ROOT / "tests" / "model"
MODULES = {module.__name__.rpartition(".")[2]: module for module in (appraisal, equations, hearing, mind, motivation)}

#: The Appendix from its beginning to its end: its name -> where it is; and the tests, where they call it not by its name.
APPENDIX: tuple[tuple[str, str, tuple[str, ...]], ...] = (
    ("sensory_feedback_ij(t)", "motivation.Motivation.sensory_feedback", (
        "test_mind.test_a_task_that_ceases_to_apply_is_dropped_without_blame",)),
    ("comm_received", "equations.in_window", ()),
    ("comm_received(i, k, j, t - tau, t)", "hearing.Hearing.is_on", (
        "test_hearing.test_a_lapse_is_noted_at_the_step_that_notices_it_and_ends_with_the_next_message",)),
    ("comm_received(i, k, j, 0, instant)", "hearing.Hearing.heard_until", (
        "test_mind.test_impatience_ends_phi_after_the_first_message",)),
    ("robots_present", "hearing.Hearing.robots_present", (
        "test_hearing.test_a_robot_is_present_for_less_than_tau_after_its_last_message",
        "test_properties.test_a_robot_silent_for_tau_is_absent_and_one_heard_since_is_present",)),
    ("activity_suppression_ij(t)", "appraisal.Appraisal.adaptive", (
        "test_properties.test_at_most_one_set_is_active_and_none_whose_task_is_complete",)),
    ("learning_impatience_ij(t)", "equations.learning_impatience", ()),
    ("task_time_i(k, j, t)", "equations.task_time", ()),
    ("task_category_ij(t)", "equations.task_category", ()),
    ("boredom_i(t)", "equations.boredom", ()),
    ("learned_robot_influence_ij(t)", "equations.learned_robot_influence", ()),
    ("phi_ij(k, t)", "equations.patience", ()),
    ("delta_slow_ij(k, t)", "equations.slow_rate", ()),
    ("scale_factor", "equations.scale_factor", ()),
    ("the denominator of delta_fast", "equations.delay", ()),
    ("delta_fast_ij(t)", "equations.fast_rate", ()),
    ("impatience_ij(t)", "appraisal.Appraisal._impatience", (
        "test_mind.test_each_strategy_hands_a_task_over_in_its_own_way",
        "test_mind.test_impatience_ends_phi_after_the_first_message",)),
    ("impatience_reset_ij(t)", "equations.impatience_reset", ()),
    ("psi_ij(t)", "equations.yield_time", ()),
    ("lambda_ij(t)", "equations.give_up_time", ()),
    ("acquiescence_ij(t)", "equations.acquiescence", ()),
    ("m_ij(t), active learning phase", "appraisal.Appraisal.learning", (
        "test_mind.test_motivation_grows_by_theta_times_the_draw_in_each_step",
        "test_mind.test_in_active_learning_no_robot_takes_what_a_teammate_is_on",)),
    ("m_ij(t), adaptive phase", "equations.motivation", ()),
)  # fmt: skip

#: Files of tests that a table is about, so that they need not be named in it.
USUAL = ("test_equations", "test_errata")

REPORT = ROOT / "docs" / "study" / "report.md"
#: The first interval of a cell of the report.
_INTERVAL = re.compile(r"([\d.]+) \(([\d.]+) to ([\d.]+)\)")


def appendix() -> str:
    """The Appendix's equations: name, function, what it says, tests."""
    rows = []
    for name, place, tests in APPENDIX:
        told = documented(place)
        if name not in told:
            raise ValueError(f"the docstring of {place} does not name {name}")
        said = next(part for part in told.split("\n\n") if name in part)
        rows.append((f"`{greek(name)}`<br>`{place}`", meaning(said), tested(place, tests)))
    return table(("in the Appendix, and in the code", "what it says", "tests"), rows)


def beyond() -> str:
    """The functions of `equations` that the Appendix does not have: what errata and running robots need."""
    there = {place for _, place, _ in APPENDIX}
    places = [f"equations.{name}" for name in functions() if f"equations.{name}" not in there]
    return table(
        ("function", "what it says", "tests"),
        [(f"`{place}`", meaning(documented(place)), tested(place, ())) for place in places],
    )


def functions() -> list[str]:
    """The functions of `equations`, in the order in which they stand there."""
    found = inspect.getmembers(equations, inspect.isfunction)
    own = [(inspect.getsourcelines(one)[1], name) for name, one in found if one.__module__ == equations.__name__]
    return [name for _, name in sorted(own)]


def documented(place: str) -> str:
    """The docstring of what is at `module.name` or `module.Class.name`."""
    module, *names = place.split(".")
    found: Any = MODULES[module]
    for name in names:
        found = inspect.getattr_static(found, name)
    told = inspect.getdoc(found)
    if told is None:
        raise ValueError(f"{place} has no docstring")
    return told


def meaning(docstring: str) -> str:
    """What a docstring says first, without the name of the equation before a colon."""
    first = docstring.partition("\n\n")[0].replace("\n", " ")
    first = re.sub(r"^\w+(\([^)]*\))?(, (adaptive|active learning) phase)?: ", "", first)
    if re.match("[a-z]+ ", first):
        first = first[0].upper() + first[1:]
    return greek(first).replace("|", "\\|")


def tested(place: str, named: tuple[str, ...]) -> str:
    """The tests of a function, by name.

    Raises:
        ValueError: there is none, or one that is named is not there.
    """
    calls = callers()[place.removeprefix("equations.")] if place.startswith("equations.") else []
    missing = [one for one in named if one not in written()]
    if missing or not (calls or named):
        raise ValueError(f"{place} is tested by {missing or 'nothing'}")
    return sentences((*calls, *named))


def sentences(tests: Iterable[str]) -> str:
    """Tests by what their names say, with their file where it is not the one that goes without saying."""
    said = []
    for one in dict.fromkeys(tests):
        file, _, name = one.partition(".")
        sentence = re.sub(r"^test_(\d+_)?", "", name).replace("_", " ")
        said.append(sentence if file in USUAL else f"{sentence} (`{file}.py`)")
    return "; ".join(said)


@cache
def written() -> dict[str, ast.FunctionDef | ast.AsyncFunctionDef]:
    """All tests of the model: `file.test` -> what stands there."""
    return {
        f"{path.stem}.{one.name}": one
        for path in sorted(TESTS.glob("test_*.py"))
        for one in ast.parse(path.read_text()).body
        if isinstance(one, ast.FunctionDef | ast.AsyncFunctionDef) and one.name.startswith("test_")
    }


@cache
def callers() -> dict[str, list[str]]:
    """Function of `equations` -> the tests that call it as `eq.function`."""
    found: dict[str, list[str]] = defaultdict(list)
    for name, test in written().items():
        called = {
            one.attr
            for one in ast.walk(test)
            if isinstance(one, ast.Attribute) and isinstance(one.value, ast.Name) and one.value.id == "eq"
        }
        for function in sorted(called):
            found[function].append(name)
    return found


def errata() -> str:
    """The doubtful places: number, name, both readings, which of them is the default, the test."""
    rows = []
    for number, name, literal, mended in told_errata():
        default = Erratum(name).default
        readings = [f"**{one}**" if reading is default else one for reading, one in
                    ((Reading.LITERAL, literal), (Reading.MENDED, mended))]  # fmt: skip
        tests = [one for one in written() if re.fullmatch(rf"test_errata\.test_{number}_.*", one)]
        if not tests:
            raise ValueError(f"erratum {number} has no test")
        rows.append((number, f"`{name}`", *readings, sentences(tests)))
    return table(("", "name", "literal", "mended", "tests"), rows)


def told_errata() -> Iterator[tuple[str, str, str, str]]:
    """Number, name, literal and mended reading of each erratum, as they stand beside the enumeration's members."""
    found = re.findall(r"#: (\d+)\. (.*?) -> (.*?)\.\n    \w+ = \"(\w+)\"", inspect.getsource(Erratum))
    if [name for *_, name in found] != [one.value for one in Erratum]:
        raise ValueError("not every erratum says both readings")
    for number, literal, mended, name in found:
        yield number, name, literal, greek(mended)


def costs(hand_over: str) -> str:
    """What the other reading of each erratum costs, from the study's report.

    In bold: what is surely not 1, and missions that do not end.
    """
    lines = REPORT.read_text().splitlines()
    head = next(
        at for at, line in enumerate(lines) if line.startswith(f"| {hand_over}: relative to the default reading")
    )
    circumstances = cells(lines[head])[1:]
    names = {number: name for number, name, *_ in told_errata()}
    rows = []
    for line in lines[head + 2 :]:
        if not line.startswith("|"):
            break
        place, *values = cells(line)
        number = place.split()[0]
        rows.append((f"{number} `{names[number]}`", *map(cost, values)))
    return table(("read the other way", *circumstances), rows, right=True)


def cells(line: str) -> list[str]:
    """The cells of a line of a table."""
    return [cell.strip() for cell in line.strip().strip("|").split("|")]


def cost(cell: str) -> str:
    """A cell of the report without its interval."""
    interval = _INTERVAL.search(cell)
    short = _INTERVAL.sub(r"\1", cell).replace("%", " %")
    sure = interval is None or "unfinished" in cell or not float(interval[2]) <= 1 <= float(interval[3])
    return f"**{short}**" if sure else short


PARTS: dict[str, Callable[[], str]] = {
    "appendix": appendix,
    "beyond": beyond,
    "errata": errata,
    "costs-shared": lambda: costs("shared_max"),
    "costs-restart": lambda: costs("restart"),
}
