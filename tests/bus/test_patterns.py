"""Key expressions, and that Zenoh reads them the same way."""

import pytest
import zenoh
from hypothesis import example, given, settings
from hypothesis import strategies as st

from lalliance_agents.bus.patterns import MAX_KEY, check_key, check_pattern, intersects, matches

NAMES = st.sampled_from(["a", "b", "@a", "@b"])
KEYS = st.lists(NAMES, min_size=1, max_size=6).map("/".join)
PATTERNS = st.lists(NAMES | st.sampled_from(["*", "**"]), min_size=1, max_size=6).map("/".join)
TEXTS = st.text(st.sampled_from("ab@*/$#? é\n"), max_size=8)


@pytest.mark.parametrize(
    ("pattern", "key", "expected"),
    [
        ("m/activity/*/r1", "m/activity/t1/r1", True),
        ("m/activity/*/r1", "m/activity/t1/r2", False),
        ("m/*", "m/a/b", False),
        ("m/*", "m", False),
        ("m/**", "m", True),
        ("m/**", "m/a/b", True),
        ("**/b", "m/a/b", True),
        ("**", "m/@chaos/rules", False),
        ("m/*/rules", "m/@chaos/rules", False),
        ("m/@chaos/*", "m/@chaos/rules", True),
        ("m/**/@chaos/**", "m/@chaos/rules", True),
    ],
)
def test_what_a_pattern_matches(pattern: str, key: str, expected: bool) -> None:
    assert matches(pattern, key) is expected


@settings(max_examples=500)
@given(PATTERNS, KEYS)
def test_matches_what_zenoh_matches(pattern: str, key: str) -> None:
    assert matches(pattern, key) == zenoh.KeyExpr.autocanonize(pattern).includes(key)


@settings(max_examples=1000)
@given(PATTERNS, PATTERNS)
@example("**/@a/**", "*/**/@a")
@example("**/a/**", "@a/**")
def test_intersects_where_zenoh_does(one: str, other: str) -> None:
    expected = zenoh.KeyExpr.autocanonize(one).intersects(zenoh.KeyExpr.autocanonize(other))
    assert intersects(one, other) == expected
    assert intersects(other, one) == expected


def test_many_wildcards_cost_little() -> None:
    """The work grows with the product of the lengths, not exponentially."""
    assert not intersects("/".join(["**", "a"] * 80), "/".join(["a"] * 200 + ["b"]))


@settings(max_examples=1000)
@given(TEXTS)
def test_what_passes_as_a_pattern_passes_zenoh(text: str) -> None:
    try:
        check_pattern(text)
    except ValueError:
        return
    zenoh.KeyExpr.autocanonize(text)


@pytest.mark.parametrize("key", ["", "/a", "a/", "a//b", "a/*", "a/**", "a*", "a/$*", "a#b", "a?b", "\ud800"])
def test_not_a_key(key: str) -> None:
    with pytest.raises(ValueError, match=r"not a key|surrogates not allowed"):
        check_key(key)


@pytest.mark.parametrize("pattern", ["", "/a", "a//b", "a*", "a/***", "@*", "a/$*"])
def test_not_a_pattern(pattern: str) -> None:
    with pytest.raises(ValueError, match="not a pattern"):
        check_pattern(pattern)


def test_length_is_counted_in_bytes() -> None:
    check_key("k" * MAX_KEY)
    with pytest.raises(ValueError, match="a key of 514 bytes"):
        check_key("é" * 257)
