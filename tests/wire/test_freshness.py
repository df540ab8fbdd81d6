"""Freshness: what is admitted on a stream only ever rises, and what is remembered is limited."""

from hypothesis import given, settings
from hypothesis import strategies as st

from lalliance_agents.wire.freshness import Freshness

NUMBERS = st.integers(0, 6)


@settings(deadline=None)
@given(st.lists(st.tuples(st.sampled_from("ab"), NUMBERS, NUMBERS), max_size=60))
def test_each_stream_rises_strictly_and_loses_nothing_newer(messages: list[tuple[str, int, int]]) -> None:
    freshness = Freshness()
    newest: dict[str, tuple[int, int]] = {}
    for stream, incarnation, seq in messages:
        is_newer = stream not in newest or (incarnation, seq) > newest[stream]
        assert freshness.admit(stream, incarnation, seq) == is_newer
        if is_newer:
            newest[stream] = (incarnation, seq)


def test_a_ghost_is_never_news_whatever_its_number() -> None:
    freshness = Freshness()
    assert freshness.admit("left", 1, 500)
    assert freshness.admit("left", 2, 1)
    assert not freshness.admit("left", 1, 501)
    assert freshness.admit("left", 2, 2)


def test_made_up_streams_push_out_one_another_and_none_that_is_alive() -> None:
    freshness = Freshness(most=10)
    for seq in range(200):
        assert freshness.admit("left", 2, seq)
        for made_up in range(8):
            freshness.admit((made_up, seq), 1, 1)
        assert not freshness.admit("left", 1, 1000)
    assert len(freshness._newest) == 10
