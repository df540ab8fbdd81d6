"""The queue between a bus's threads and the event loop."""

import asyncio
import logging
import threading
from collections.abc import Callable

import pytest

from lalliance_agents.bus.inbox import BATCH, CAPACITY, LONGEST_REST, REST, Inbox, Inlet


class Turns:
    """Stands for the event loop: what is scheduled runs when a test says so."""

    def __init__(self) -> None:
        self.scheduled = []

    def wake(self, call: Callable[[], None]) -> None:
        self.scheduled.append(call)

    def turn(self) -> int:
        now, self.scheduled = self.scheduled, []
        for call in now:
            call()
        return len(now)


class Loop(Turns):
    """The same with a clock; what is to run later runs when a test lets time pass."""

    def __init__(self) -> None:
        super().__init__()
        self.now = 0.0
        self.later = []

    def time(self) -> float:
        return self.now

    def call_later(self, delay: float, call: Callable[[], None]) -> None:
        self.later.append((delay, call))

    def passes(self, seconds: float) -> None:
        self.now += seconds
        due, self.later = self.later, []
        for _, call in due:
            call()


def test_when_messages_throng_the_loop_rests_and_takes_all_that_came_meanwhile() -> None:
    loop, heard = Loop(), []
    inbox = Inbox(loop.wake, loop)
    inlet = Inlet("x", heard.append)
    inbox.push(inlet, 1)
    assert (loop.turn(), heard, loop.later) == (1, [1], [])
    loop.passes(REST / 4)
    inbox.push(inlet, 2)
    assert (loop.turn(), heard) == (1, [1, 2])
    assert [delay for delay, _ in loop.later] == [REST]
    for number in (3, 4):
        inbox.push(inlet, number)
    assert loop.turn() == 0
    loop.passes(REST)
    assert (heard, len(loop.later)) == ([1, 2, 3, 4], 1)
    inbox.push(inlet, 5)
    loop.passes(REST)
    assert (heard, loop.later) == ([1, 2, 3, 4, 5], [])
    inbox.push(inlet, 6)
    assert (loop.turn(), heard[5:]) == (1, [6])


def test_one_wake_up_per_batch_and_a_bounded_batch_per_turn() -> None:
    turns, heard = Turns(), []
    inbox = Inbox(turns.wake)
    inlet = Inlet("x", heard.append)
    for number in range(BATCH + 1):
        inbox.push(inlet, number)
    assert len(turns.scheduled) == 1
    assert turns.turn() == 1
    assert heard == list(range(BATCH))
    assert turns.turn() == 1
    assert heard == list(range(BATCH + 1))
    assert turns.turn() == 0


def test_lazy_messages_wake_nobody_and_come_in_their_turn_when_they_are_collected_or_somebody_is_woken() -> None:
    turns, heard = Turns(), []
    inbox = Inbox(turns.wake)
    lazy, eager = Inlet("lazy", heard.append, lazy=True), Inlet("eager", heard.append)
    for number in range(2):
        inbox.push(lazy, number)
    assert (turns.scheduled, heard) == ([], [])
    assert inbox.collect()
    assert (turns.scheduled, heard) == ([], [0, 1])
    inbox.push(lazy, 2)
    inbox.push(eager, 3)
    inbox.push(lazy, 4)
    assert (turns.turn(), heard) == (1, [0, 1, 2, 3, 4])
    inbox.push(eager, 5)
    assert inbox.collect()
    assert heard[5:] == [5]
    assert (turns.turn(), turns.turn()) == (1, 0)
    inbox.push(lazy, 6)
    assert (turns.scheduled, len(inbox)) == ([], 1)


def test_a_flood_of_lazy_messages_wakes_the_loop_once_and_however_often_it_is_collected() -> None:
    turns, heard = Turns(), []
    inbox = Inbox(turns.wake)
    lazy = Inlet("lazy", heard.append, lazy=True)
    for number in range(5 * BATCH):
        inbox.push(lazy, number)
    assert len(turns.scheduled) == 1
    for _ in range(2):
        assert inbox.collect()
    assert (len(turns.scheduled), heard) == (1, list(range(2 * BATCH)))
    assert [turns.turn() for _ in range(4)] == [1, 1, 1, 0]
    assert heard == list(range(5 * BATCH))


def test_who_collects_time_and_again_leaves_at_least_half_of_the_time_to_others() -> None:
    loop, heard = Loop(), []
    inbox = Inbox(loop.wake, loop)

    def dawdle(number: int) -> None:
        heard.append(number)
        loop.now += LONGEST_REST

    lazy = Inlet("lazy", dawdle, lazy=True)
    for number in range(4):
        inbox.push(lazy, number)
        assert inbox.collect()
    assert heard == [0]
    loop.now += 0.9 * LONGEST_REST
    assert inbox.collect()
    assert heard == [0]
    loop.now += 0.2 * LONGEST_REST
    assert inbox.collect()
    assert heard == [0, 1, 2, 3]
    assert loop.scheduled == []


def test_a_collection_that_was_held_up_does_not_keep_the_next_ones_from_their_messages() -> None:
    loop, heard = Loop(), []
    inbox = Inbox(loop.wake, loop)

    def stand_still(number: int) -> None:
        heard.append(number)
        loop.now += 5.0 if number == 0 else 0.0

    lazy = Inlet("lazy", stand_still, lazy=True)
    inbox.push(lazy, 0)
    assert inbox.collect()
    inbox.push(lazy, 1)
    loop.now += LONGEST_REST
    assert inbox.collect()
    assert heard == [0, 1]


def test_what_collecting_leaves_over_is_delivered_without_being_collected() -> None:
    turns, heard = Turns(), []
    inbox = Inbox(turns.wake)

    def fail(_: int) -> None:
        raise KeyboardInterrupt

    inbox.push(Inlet("fail", fail, lazy=True), 0)
    inbox.push(Inlet("lazy", heard.append, lazy=True), 1)
    with pytest.raises(KeyboardInterrupt):
        inbox.collect()
    assert heard == []
    assert (turns.turn(), heard) == (1, [1])


def test_a_handler_that_collects_is_told_that_it_cannot() -> None:
    turns, heard = Turns(), []
    inbox = Inbox(turns.wake)
    inbox.push(Inlet("x", lambda _: heard.append(inbox.collect())), 0)
    inbox.push(Inlet("y", heard.append), 1)
    turns.turn()
    assert heard == [False, 1]
    assert inbox.collect()


def test_a_flood_drops_the_oldest_but_nothing_that_must_be_kept() -> None:
    turns, heard, dropped = Turns(), [], []
    inbox = Inbox(turns.wake)
    data = Inlet("data", heard.append, discard=dropped.append)
    watch = Inlet("watch", heard.append, keep=True)
    inbox.push(data, "first")
    inbox.push(watch, "present")
    for number in range(CAPACITY):
        inbox.push(data, number)
    assert (inbox.dropped_overflow, dropped) == (1, ["first"])
    assert len(inbox) == CAPACITY + 1
    while turns.turn():
        pass
    assert heard == ["present", *range(CAPACITY)]


def test_what_waits_for_a_closed_registration_is_discarded() -> None:
    turns, heard, discarded = Turns(), [], []
    inbox = Inbox(turns.wake)
    inlet = Inlet("x", heard.append, discard=discarded.append)
    inbox.push(inlet, 1)
    inlet.is_open = False
    turns.turn()
    inlet.is_open = True
    inbox.push(inlet, 2)
    inbox.close()
    inbox.push(inlet, 3)
    turns.turn()
    assert (heard, discarded, len(inbox)) == ([], [1, 2, 3], 0)


def test_a_failing_handler_is_logged_once_per_kind(caplog: pytest.LogCaptureFixture) -> None:
    turns, failures = Turns(), [KeyError("a"), KeyError("b"), TypeError("c")]
    inbox = Inbox(turns.wake)

    def fail(number: int) -> None:
        raise failures[number]

    inlet = Inlet("the subscription 'k'", fail)
    with caplog.at_level(logging.ERROR):
        for number in range(3):
            inbox.push(inlet, number)
        turns.turn()
    assert [record.exc_info[1] for record in caplog.records] == [failures[0], failures[2]]


def test_an_exit_from_a_handler_leaves_the_rest_for_the_next_turn() -> None:
    turns, heard = Turns(), []
    inbox = Inbox(turns.wake)

    def leave(_: int) -> None:
        raise KeyboardInterrupt

    inbox.push(Inlet("leave", leave), 0)
    inbox.push(Inlet("x", heard.append), 1)
    with pytest.raises(KeyboardInterrupt):
        turns.turn()
    turns.turn()
    assert heard == [1]


def test_a_closed_loop_is_not_the_sender_s_problem() -> None:
    loop = asyncio.new_event_loop()
    inbox = Inbox(loop.call_soon_threadsafe)
    loop.close()
    discarded = []
    inbox.push(Inlet("x", print, discard=discarded.append), 1)
    inbox.push(Inlet("x", print, discard=discarded.append), 2)
    assert discarded == [1, 2]


async def test_pushes_from_many_threads_all_arrive_in_each_thread_s_order() -> None:
    heard, done = [], asyncio.Event()
    inbox = Inbox(asyncio.get_running_loop().call_soon_threadsafe)
    count = CAPACITY // 4

    def hear(item: tuple[int, int]) -> None:
        heard.append(item)
        if len(heard) == 4 * count:
            done.set()

    inlet = Inlet("x", hear)
    threads = [
        threading.Thread(target=lambda who=who: [inbox.push(inlet, (who, number)) for number in range(count)])
        for who in range(4)
    ]
    for thread in threads:
        thread.start()
    async with asyncio.timeout(20):
        await done.wait()
    for thread in threads:
        thread.join()
    for who in range(4):
        assert [number for sender, number in heard if sender == who] == list(range(count))
