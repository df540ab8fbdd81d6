"""The plugin as its users see it: pytest runs inside pytest, on simulated missions, which take no time."""

import math
import re
from collections.abc import Sequence
from pathlib import Path

import pytest

# Inner runs forget what they import; what is imported here already is not loaded again by each of them.
import lalliance_testing.launch
import lalliance_testing.twin  # noqa: F401
from lalliance_agents.mission_file import parse_mission
from lalliance_study.simulator import Simulator

pytestmark = pytest.mark.alone

pytest_plugins = "pytester"

MISSION = '''
MISSION = """
name: pair
tasks: {a: {}, b: {}}
robots:
  left: {tasks: {a: 5, b: 9}}
  right: {tasks: {a: 9, b: 5}}
knowledge: given
parameters: {min_delay: 0.1, max_delay: 0.4}
seed: 7
"""
'''


@pytest.fixture(autouse=True)
def _quiet(pytester: pytest.Pytester) -> None:
    pytester.makeini(
        "[pytest]\nasyncio_default_fixture_loop_scope = function\naddopts = -p no:cacheprovider -p no:hypothesispytest\n"
    )


def run(pytester: pytest.Pytester, body: str, *options: str, engine: str = "simulated") -> pytest.RunResult:
    """Run one test file whose test `test_it` has this body."""
    lines = "\n".join(f"    {line}" for line in body.strip().splitlines())
    pytester.makepyfile(f"import pytest\n{MISSION}\ndef test_it(lalliance_mission):\n{lines}\n")
    return pytester.runpytest_inprocess(f"--lalliance-engine={engine}", *options)


def told(result: pytest.RunResult) -> str:
    """The errors that the run tells."""
    return "\n".join(line.removeprefix("E").strip() for line in result.outlines if line.startswith("E  "))


def test_a_mission_is_waited_for_step_by_step_and_finished(pytester: pytest.Pytester) -> None:
    result = run(
        pytester,
        """
mission = lalliance_mission(MISSION)
mission.wait_for("activate", robot="left", task="a")
crash = mission.inject(kind="crash", robot="left")
takeover = mission.wait_for("takeover", robot="right", cause="silence", within=20)
assert (takeover.task, takeover.other) == ("a", "left")
assert mission.faults()[crash]["fired"]
assert mission.finish()["complete"]
assert [event.cause for event in mission.happened("end")] == ["complete"]
""",
    )
    result.assert_outcomes(passed=1)


SCHEDULED = 'mission = lalliance_mission(MISSION + "faults: [{at: 1, robot: left, kind: slow, factor: 2}, %s]")\n'
NEVER_DUE = SCHEDULED % "{at: 50, robot: left, kind: crash}"
NOTHING_TO_DO = SCHEDULED % "{at: 0.1, until: 0.2, robot: right, kind: stuck}"


@pytest.mark.parametrize("end", ['mission.wait_for("complete", task="b")', "mission.finish()"])
@pytest.mark.parametrize(
    ("start", "sentence"),
    [
        (
            NEVER_DUE,
            "fault 2-crash (crash of left) never fired: it was due at 50.0 s, and the mission did not last until then",
        ),
        (
            NOTHING_TO_DO,
            "fault 2-stuck (stuck of right) never fired: it was in force from 0.1 s until 0.2 s, but there was nothing",
        ),
    ],
)
def test_a_test_with_a_fault_that_never_fires_fails_by_itself(
    pytester: pytest.Pytester, start: str, sentence: str, end: str
) -> None:
    result = run(pytester, start + end)
    result.assert_outcomes(failed=1)
    assert sentence in result.stdout.str()


def test_an_injected_fault_that_never_fires_fails_the_test_too(pytester: pytest.Pytester) -> None:
    result = run(
        pytester,
        """
mission = lalliance_mission(MISSION)
mission.wait_for("complete", task="b")
mission.inject(kind="stuck", robot="right", task="a", lasts=0.5)
""",
    )
    result.assert_outcomes(failed=1)
    assert "fault 1-stuck (stuck of right at a) never fired" in result.stdout.str()


@pytest.mark.parametrize("excuse", ["2-crash", "crash of left"])
@pytest.mark.parametrize("end", ['mission.wait_for("complete", task="b")', "mission.finish()"])
def test_unless_it_says_that_it_may_not_fire(pytester: pytest.Pytester, excuse: str, end: str) -> None:
    start = NEVER_DUE.replace(']")', f']", may_not_fire=["{excuse}"])')
    run(pytester, start + end).assert_outcomes(passed=1)


def test_an_injected_fault_may_be_excused_as_well(pytester: pytest.Pytester) -> None:
    body = (
        'mission = lalliance_mission(MISSION)\nmission.inject(kind="stuck", robot="left", lasts=0.1, may_not_fire=True)'
    )
    run(pytester, body).assert_outcomes(passed=1)


def test_a_test_that_fails_anyway_is_not_blamed_for_faults_too(pytester: pytest.Pytester) -> None:
    result = run(pytester, NEVER_DUE + "assert 1 == 2")
    result.assert_outcomes(failed=1)
    assert "never fired" not in result.stdout.str()


def test_an_asynchronous_test_is_judged_as_well(pytester: pytest.Pytester) -> None:
    pytester.makepyfile(
        f"""
import pytest
{MISSION}
@pytest.mark.asyncio
async def test_it(lalliance_mission):
    lalliance_mission(MISSION + "faults: [{{at: 50, robot: left, kind: crash}}]")
"""
    )
    result = pytester.runpytest_inprocess("--lalliance-engine=simulated")
    result.assert_outcomes(failed=1)
    assert "never fired" in result.stdout.str()


def test_a_failed_test_tells_what_happened_last_and_how_to_repeat_it(pytester: pytest.Pytester) -> None:
    result = run(
        pytester,
        """
mission = lalliance_mission(MISSION, seed=9)
mission.wait_for("takeover", robot="left", within=3)
""",
    )
    result.assert_outcomes(failed=1)
    assert told(result) == "lalliance_testing.blame.ExpectationError: no takeover robot=left within 3 s"
    result.stdout.re_match_lines(
        [
            r">       mission.wait_for\(.*",
            r"-+ lalliance mission pair \(simulated, seed 9\) -+",
            r"    0.0 s  trial 1 begins \(adaptive learning\)",
            r"    0.\d s  left starts a: nobody is on it",
            r"To repeat it: pytest '.*test_a_failed_test.*.py::test_it\[simulated\]' --lalliance-seed 9",
            r"The mission alone: lalliance simulate .*/mission-1.yaml --seed 9 --events",
        ],
        consecutive=False,
    )


def test_a_failed_test_tells_the_faults_that_it_injected_so_that_they_can_be_repeated(
    pytester: pytest.Pytester,
) -> None:
    body = """
mission = lalliance_mission(MISSION)
mission.wait_for("activate", robot="left", task="a")
mission.inject(kind="stuck", robot="left", task="a", lasts=1.5)
mission.inject(link={"from": "left", "to": "right"}, loss=0.5)
crash = mission.inject(kind="crash", robot="right")
mission.wait_for("gone", robot="right")
mission.heal(crash)
mission.wait_for("present", robot="right")
mission.inject(kind="slow", robot="right", factor=2, lasts=1e6)
mission.finish()
mission.wait_for("takeover", robot="left", task="nothing")
"""
    result = run(pytester, body)
    result.assert_outcomes(failed=1)
    lines = result.outlines
    first = lines.index("with the faults that the test injected, as lines of its faults:") + 1
    faults = lines[first : first + 4]
    [file] = [Path(line.split()[5]) for line in lines if line.startswith("The mission alone: lalliance simulate")]
    repeated = parse_mission(file.read_text() + "faults:\n" + "\n".join(faults), "repeated.yaml")
    stuck, lossy, crash, slow = repeated.faults
    assert (stuck.at, stuck.end) == (lossy.at, pytest.approx(lossy.at + 1.5))
    assert (lossy.end, slow.end) == (math.inf, math.inf)
    assert crash.at == lossy.at < crash.end < slow.at
    summary = Simulator(repeated).run()
    [told] = [line for line in lines if re.search(r" s  complete after ", line)]
    assert told.split("after ")[1] == f"{summary['makespan']:.1f} s"


def test_a_mission_that_misses_its_deadline_fails_the_test_that_finishes_it(pytester: pytest.Pytester) -> None:
    body = 'mission = lalliance_mission(MISSION + "deadline: 4")\nmission.finish(%s)'
    result = run(pytester, body % "")
    result.assert_outcomes(failed=1)
    assert told(result).endswith("mission pair was not complete by its deadline of 4 s; left: a, b")
    run(pytester, body % "complete=False").assert_outcomes(passed=1)
    result = run(pytester, body.replace("4", "40") % "complete=False")
    assert re.search(r"mission pair is complete after 5\.\d s; its test expected it to fail", told(result))


def test_a_mission_that_ends_is_not_waited_for_any_longer(pytester: pytest.Pytester) -> None:
    result = run(pytester, 'lalliance_mission(MISSION).wait_for("takeover")')
    assert re.search(r"no takeover before the mission ended: complete after 5\.\d s", told(result))


BAD = {
    'lalliance_mission("no-such.yaml")': "no-such.yaml: no such file",
    'lalliance_mission(MISSION + "deadlin: 4")': "mission-1.yaml:10: deadlin: unknown field; did you mean 'deadline'?",
    "lalliance_mission(MISSION, speed=0)": "speed 0 is not allowed; expected a number from 0.01 to 1000",
    "lalliance_mission(MISSION, seed=-1)": "seed -1 is not allowed; expected a whole number from 0 on",
    'lalliance_mission(MISSION, may_not_fire=["1-crash"])': "may_not_fire: '1-crash' is no fault of this mission",
    'lalliance_mission(MISSION).wait_for("takover")': "'takover' is not a kind of event; did you mean 'takeover'?",
    'lalliance_mission(MISSION).wait_for("gone", robot="lef")': "'lef' is not a robot of this mission; did you mean 'left'?",
    'lalliance_mission(MISSION).wait_for("complete", task="c")': "'c' is not a task of this mission; expected one of a, b",
    'lalliance_mission(MISSION).wait_for("gone", name="left")': "'name' is not a fact of an event",
    'lalliance_mission(MISSION).happened("yield", cause="silense")': "'silense' is not a cause; did you mean 'silence'?",
    'lalliance_mission(MISSION).inject(kind="hangs", robot="left")': "kind: 'hangs' is not allowed; expected one of crash",
    'lalliance_mission(MISSION).inject(kind="hang", robot="lef")': "robot: 'lef' is not a robot of this mission; did you mean",
    'lalliance_mission(MISSION).inject(kind="hang", robot="left", until=3)': "until: an injected fault begins now",
    'lalliance_mission(MISSION).inject(kind={"hang"}, robot="left")': "the fault is not plain data",
    'lalliance_mission(MISSION).heal("1-hang")': "no fault '1-hang' is in force; expected one of: none",
    "lalliance_mission(MISSION).kill_router()": "a simulated mission has no router that could be killed; expected the marker",
}


@pytest.mark.parametrize("body", BAD)
def test_bad_use_gets_one_sentence_at_its_line(pytester: pytest.Pytester, body: str) -> None:
    result = run(pytester, body)
    result.assert_outcomes(failed=1)
    assert BAD[body] in told(result)
    assert len(told(result).splitlines()) == 1
    assert "lalliance_testing/" not in re.sub(r"(?s)-+ lalliance mission.*", "", result.stdout.str())


MARKED = """
import pytest

def test_plain(lalliance_mission): pass

@pytest.mark.lalliance(engine="real")
def test_real(lalliance_mission): pass

@pytest.mark.lalliance(engine="simulated", speed=2)
def test_simulated(lalliance_mission): pass

@pytest.mark.lalliance(engine="both")
def test_both(lalliance_mission): pass

def test_other(): pass
"""


@pytest.mark.parametrize(
    ("options", "run", "skipped"),
    [
        ([], "plain[real] real[real] simulated[simulated] both[real] both[simulated] other", ""),
        (["real"], "plain[real] real[real] both[real] other", "simulated[simulated]"),
        (["simulated"], "plain[simulated] simulated[simulated] both[simulated] other", "real[real]"),
        (
            ["both"],
            "plain[real] plain[simulated] real[real] simulated[simulated] both[real] both[simulated] other",
            "",
        ),
    ],
)
def test_a_test_runs_on_the_engines_that_it_and_the_command_line_ask_for(
    pytester: pytest.Pytester, options: Sequence[str], run: str, skipped: str
) -> None:
    pytester.makepyfile(MARKED)
    result = pytester.runpytest_inprocess("-v", *(f"--lalliance-engine={option}" for option in options))
    outcomes = re.findall(r"::test_(\S+) (PASSED|SKIPPED)", result.stdout.str())
    assert " ".join(name for name, outcome in outcomes if outcome == "PASSED") == run
    assert " ".join(name for name, outcome in outcomes if outcome == "SKIPPED") == skipped


@pytest.mark.parametrize(
    ("marker", "sentence"),
    [
        ("engine='fast'", "marker lalliance: engine 'fast' is unknown; expected one of 'real', 'simulated', 'both'"),
        ("speed='4'", "marker lalliance: speed '4' is not allowed; expected a number from 0.01 to 1000"),
        ("'both'", "marker lalliance: 'both' is unknown; expected engine= and speed=, as in engine='both', speed=4"),
        ("sped=4", "marker lalliance: sped is unknown; expected engine= and speed=, as in engine='both', speed=4"),
    ],
)
def test_a_bad_marker_gets_one_sentence(pytester: pytest.Pytester, marker: str, sentence: str) -> None:
    pytester.makepyfile(f"import pytest\n@pytest.mark.lalliance({marker})\ndef test_it(lalliance_mission): pass\n")
    result = pytester.runpytest_inprocess()
    result.assert_outcomes(errors=1)
    assert sentence in result.stdout.str()
    assert "Traceback" not in result.stdout.str()


@pytest.mark.parametrize(
    ("option", "sentence"),
    [
        ("--lalliance-engine=fast", "invalid choice: 'fast'"),
        ("--lalliance-speed=fast", "speed 'fast' is not allowed; expected a number from 0.01 to 1000"),
        ("--lalliance-speed=0", "speed 0.0 is not allowed; expected a number from 0.01 to 1000"),
        ("--lalliance-seed=1.5", "seed '1.5' is not allowed; expected a whole number from 0 on"),
    ],
)
def test_a_bad_option_gets_one_sentence(pytester: pytest.Pytester, option: str, sentence: str) -> None:
    pytester.makepyfile("def test_it(): pass")
    result = pytester.runpytest_inprocess(option)
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    assert sentence in result.stderr.str()


def test_the_command_line_has_the_last_word_on_seed_and_speed(pytester: pytest.Pytester) -> None:
    body = "mission = lalliance_mission(MISSION, seed=3, speed=2)\nassert (mission.mission.seed, mission.speed) == %s"
    run(pytester, body % "(3, 2.0)").assert_outcomes(passed=1)
    run(pytester, body % "(11, 5.0)", "--lalliance-seed=11", "--lalliance-speed=5").assert_outcomes(passed=1)


def test_a_mission_file_is_found_beside_its_test_or_from_the_current_directory(pytester: pytest.Pytester) -> None:
    mission = MISSION.split('"""')[1]
    folder = pytester.mkdir("elsewhere")
    (folder / "beside.yaml").write_text(mission.replace("pair", "beside"))
    (pytester.path / "here.yaml").write_text(mission.replace("pair", "here"))
    (folder / "test_files.py").write_text(
        "def test_it(lalliance_mission):\n"
        "    names = [lalliance_mission(file).mission.name for file in ('beside.yaml', 'here.yaml')]\n"
        "    assert names == ['beside', 'here']\n"
    )
    pytester.runpytest_inprocess("--lalliance-engine=simulated").assert_outcomes(passed=1)


def test_loading_the_plugin_loads_nothing_heavy(pytester: pytest.Pytester) -> None:
    code = (
        "import sys, lalliance_testing.plugin\n"
        "heavy = {'zenoh', 'pydantic', 'numpy', 'yaml', 'rich', 'asyncio', 'lalliance_agents', 'mission_control'}\n"
        "assert not heavy & (sys.modules.keys()), heavy & sys.modules.keys()\n"
    )
    assert pytester.runpython_c(code).ret == 0
