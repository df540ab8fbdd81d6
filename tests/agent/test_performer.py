"""The body: one behaviour set at a time, each cleaned up before the next, and none that holds the robot for ever."""

import asyncio
from collections.abc import Awaitable, Callable

import pytest

from lalliance_agents.agent.behavior import BehaviorSet
from lalliance_agents.agent.performer import CLEAN_UP_LIMIT, Performer

pytestmark = pytest.mark.virtual_time


class Body:
    """A performer, and the log of what its sets did and of what it said about them."""

    def __init__(self) -> None:
        self.log: list[str] = []
        self.performer = Performer(
            lambda one: self.log.append(f"{one.task} failed"), lambda one: self.log.append(f"{one.task} returned")
        )

    def start(self, task: str, act: Callable[[], Awaitable[None]] | None = None) -> BehaviorSet:
        """Start a set that logs when it begins and ends, and otherwise does `act`."""
        log = self.log

        class Logged(BehaviorSet):
            async def perform(self) -> None:
                log.append(f"{self.task} begins")
                try:
                    await (act or super().perform)()
                finally:
                    log.append(f"{self.task} ends")

        one = Logged(task)
        self.performer.start(one)
        return one


async def clean_up_slowly(seconds: float) -> None:
    try:
        await asyncio.Event().wait()
    finally:
        await asyncio.sleep(seconds)


async def never_end() -> None:
    while True:
        try:
            await asyncio.sleep(1000.0)
        except asyncio.CancelledError:
            if asyncio.get_running_loop().time() > 500:
                raise


async def settle() -> None:
    """Let everything happen that needs no time."""
    for _ in range(10):
        await asyncio.sleep(0)


async def test_a_stopped_set_cleans_up_before_the_next_one_begins() -> None:
    body = Body()
    body.start("a", lambda: clean_up_slowly(1.5))
    await settle()
    assert body.performer.task == "a"
    body.performer.stop("a")
    assert body.performer.task is None
    body.start("b")
    assert body.performer.task == "b"
    await asyncio.sleep(1.4)
    assert body.log == ["a begins"]
    await asyncio.sleep(0.2)
    await body.performer.close()
    assert body.log == ["a begins", "a ends", "b begins", "b ends"]


async def test_a_set_that_does_not_end_is_left_behind_once_and_holds_up_nobody_again(
    caplog: pytest.LogCaptureFixture,
) -> None:
    body = Body()
    loop = asyncio.get_running_loop()
    body.start("stuck", never_end)
    await settle()
    body.performer.stop("stuck")
    body.start("b")
    await asyncio.sleep(CLEAN_UP_LIMIT - 0.01)
    assert body.log == ["stuck begins"]
    await asyncio.sleep(0.02)
    assert body.log == ["stuck begins", "b begins"]
    body.performer.stop("b")
    body.start("c")
    await settle()
    assert body.log == ["stuck begins", "b begins", "b ends", "c begins"]
    before = loop.time()
    await body.performer.close()
    assert loop.time() == before
    assert [record.message for record in caplog.records] == [
        "perform stuck did not end within 2 s of being stopped; going on"
    ]
    await asyncio.sleep(500)
    [left] = body.performer._left_behind
    left.cancel()
    await settle()
    assert not body.performer._left_behind


async def test_closing_waits_for_the_clean_up_within_the_limit() -> None:
    body = Body()
    body.start("a", lambda: clean_up_slowly(1.0))
    body.start("b")
    await settle()
    await body.performer.close()
    assert body.log == ["a begins", "b begins", "b ends", "a ends"]
    assert asyncio.get_running_loop().time() == pytest.approx(1.0)


async def test_return_and_failure_are_reported_and_leave_the_set_on_its_task(caplog: pytest.LogCaptureFixture) -> None:
    async def jam() -> None:
        raise RuntimeError("jammed")

    async def leave() -> None:
        raise SystemExit(1)

    async def lose_a_helper() -> None:
        helper = asyncio.create_task(asyncio.sleep(1000))
        asyncio.get_running_loop().call_soon(helper.cancel)
        await helper

    body = Body()
    for task, act in {"a": jam, "b": leave, "c": lose_a_helper}.items():
        body.start(task, act)
        await settle()
        body.performer.stop(task)
    done = body.start("d", lambda: asyncio.sleep(1.0))
    await asyncio.sleep(1.1)
    expected = [f"{task} {what}" for task in "abc" for what in ("begins", "ends", "failed")]
    assert body.log == [*expected, "d begins", "d ends", "d returned"]
    assert (done.returned, body.performer.task) == (True, "d")
    assert len(caplog.records) == 3
    assert "jammed" in caplog.text


async def test_a_perform_that_is_not_async_is_told_so(caplog: pytest.LogCaptureFixture) -> None:
    class Plain(BehaviorSet):
        def perform(self) -> None:  # type: ignore[override]
            """What a beginner writes."""

    body = Body()
    body.performer.start(Plain("a"))
    await settle()
    assert body.log == ["a failed"]
    assert "perform of <Plain for a> is an ordinary function; expected async def perform" in caplog.text


async def test_what_a_set_does_after_it_was_stopped_says_nothing_about_its_task(
    caplog: pytest.LogCaptureFixture,
) -> None:
    async def swallow() -> None:
        try:
            await asyncio.Event().wait()
        except asyncio.CancelledError:
            return

    async def fail_at_the_end() -> None:
        try:
            await asyncio.Event().wait()
        finally:
            raise RuntimeError("jammed while cleaning up")

    body = Body()
    sets = [body.start("a", swallow), body.start("b", fail_at_the_end)]
    await settle()
    await body.performer.close()
    assert body.log == ["a begins", "b begins", "a ends", "b ends"]
    assert not any(one.returned for one in sets)
    assert "jammed while cleaning up" in caplog.text


async def test_a_set_stopped_before_it_began_never_begins_and_what_does_not_run_can_be_stopped() -> None:
    body = Body()
    body.start("a")
    body.performer.stop("a")
    body.performer.stop("a")
    body.performer.stop("unknown")
    body.start("a")
    await settle()
    await body.performer.close()
    await body.performer.close()
    assert body.log == ["a begins", "a ends"]


async def test_a_set_whose_repr_fails_fails_like_any_other(caplog: pytest.LogCaptureFixture) -> None:
    class Nameless(BehaviorSet):
        async def perform(self) -> None:
            raise RuntimeError("jammed")

        def __repr__(self) -> str:
            raise ValueError("no name")

    body = Body()
    body.performer.start(Nameless("a"))
    await settle()
    assert body.log == ["a failed"]
    assert [record.message for record in caplog.records] == ["<Nameless> failed"]
