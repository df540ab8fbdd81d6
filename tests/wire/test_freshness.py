"""Freshness: what is admitted on a stream only ever rises, and what is remembered is limited."""

from hypothesis import given, settings
from hypothesis import strategies as st

from lalliance_agents.wire.freshness import Freshness, Newest

NUMBERS = st.integers(0, 6)


def is_news(freshness: Freshness, stream: object, incarnation: int, seq: int) -> bool:
    return freshness.overtaken(stream, incarnation, seq, 0.0) is None


@settings(deadline=None)
@given(st.lists(st.tuples(st.sampled_from("ab"), NUMBERS, NUMBERS), max_size=60))
def test_each_stream_rises_strictly_and_loses_nothing_newer(messages: list[tuple[str, int, int]]) -> None:
    freshness = Freshness()
    newest: dict[str, tuple[int, int]] = {}
    for stream, incarnation, seq in messages:
        is_newer = stream not in newest or (incarnation, seq) > newest[stream]
        assert is_news(freshness, stream, incarnation, seq) == is_newer
        if is_newer:
            newest[stream] = (incarnation, seq)


def test_a_ghost_is_never_news_whatever_its_number() -> None:
    freshness = Freshness()
    assert is_news(freshness, "left", 1, 500)
    assert is_news(freshness, "left", 2, 1)
    assert not is_news(freshness, "left", 1, 501)
    assert is_news(freshness, "left", 2, 2)


def test_made_up_streams_push_out_one_another_and_none_that_is_alive() -> None:
    freshness = Freshness(most=10)
    for seq in range(200):
        assert is_news(freshness, "left", 2, seq)
        for made_up in range(8):
            assert is_news(freshness, (made_up, seq), 1, 1)
        assert not is_news(freshness, "left", 1, 1000)
    assert len(freshness._newest) == 10


def test_what_comes_behind_the_newest_is_counted_until_something_new_comes() -> None:
    freshness = Freshness()
    assert freshness.overtaken("left", 1, 5, 3.0) is None
    for seq in (4, 5):
        newest = freshness.overtaken("left", 1, seq, 4.0)
    assert newest == Newest(incarnation=1, seq=5, at=3.0, stale=2)
    assert freshness.overtaken("left", 1, 6, 5.0) is None
    assert freshness.overtaken("left", 1, 6, 6.0) == Newest(incarnation=1, seq=6, at=5.0, stale=1)
