"""The decoder under tens of thousands of hostile messages; see `wire.fuzz` for a million of them, and for what it proves."""

from random import Random
from typing import Literal

import pytest
from pydantic import Field
from wire.cases import Cases
from wire.fuzz import fuzz
from wire.samples import CannotSampleError, valid

from lalliance_agents.wire import messages
from lalliance_agents.wire.keys import Kind
from lalliance_agents.wire.messages import FIRST_FAULT, Heartbeat, Message

pytestmark = pytest.mark.virtual_time


async def test_whatever_comes_is_accepted_whole_or_refused_in_one_line_and_every_check_is_reached() -> None:
    report = await fuzz(seed=1, cases=40_000, slow=0.4)
    assert report.defects == []
    assert report.missing == set()
    assert report.outcomes.total() == report.cases == 40_000


def test_the_same_seed_gives_the_same_cases() -> None:
    one, same, other = (Cases(Random(seed)) for seed in (5, 5, 6))
    cases = [one.next() for _ in range(500)]
    assert cases == [same.next() for _ in range(500)]
    assert cases != [other.next() for _ in range(500)]


async def test_a_decoder_with_a_defect_is_found_out(monkeypatch: pytest.MonkeyPatch) -> None:
    """Here one that takes each map to have a version."""
    unpack = messages._unpack

    def fragile(payload: bytes) -> object:
        document = unpack(payload)
        return document["v"] and document

    monkeypatch.setattr(messages, "_unpack", fragile)
    assert any("KeyError" in defect for defect in (await fuzz(seed=1, cases=2000, slow=0.4)).defects)


class Unheard(Message):
    """A kind as somebody may add it, with all that a field can be."""

    word: Literal["a", "b"]
    many: list[dict[str, int | None]] = Field(min_length=1, fail_fast=True)
    inner: dict[str, Heartbeat] = FIRST_FAULT
    share: float = Field(gt=0, lt=1)
    number: int = Field(gt=3, le=5)


class Unheardof(Message):
    """A kind with a field for which no values are known."""

    places: complex


class Unmeetable(Message):
    """A kind with a field that chance does not meet."""

    word: str = Field(pattern="^[A-Z]{7}$")


def test_a_kind_that_is_added_is_sampled_as_it_is_declared(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(messages.BODY_OF, Kind.HELLO, Unheard)
    drawn = [valid(Kind.HELLO, Random(seed)).document for seed in range(50)]
    assert {document["word"] for document in drawn} == {"a", "b"}
    assert {document["number"] for document in drawn} == {4, 5}


@pytest.mark.parametrize("kind", [Unheardof, Unmeetable])
def test_a_kind_that_cannot_be_sampled_is_told(kind: type[Message], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(messages.BODY_OF, Kind.HELLO, kind)
    with pytest.raises(CannotSampleError, match=r"teach wire.samples"):
        Cases(Random(1))
