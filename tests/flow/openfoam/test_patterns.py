"""Patterns for patch names: the same answers as regular expressions, and quick for any of them."""

from __future__ import annotations

import re

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ellipsoid_coupling.flow.openfoam.patterns import matches

_ATOMS = st.sampled_from(["a", "b", ".", "[ab]", "[^b]", r"\.", "1"])


def _parts(inner: st.SearchStrategy[str]) -> st.SearchStrategy[str]:
    repeated = st.tuples(inner, st.sampled_from(["", "*", "+", "?"])).map("".join)
    repeated = repeated.filter(
        lambda text: text[-2:-1] not in ("*", "+", "?") or text[-1] not in "*+?"
    )
    sequence = st.lists(repeated, max_size=3).map("".join)
    return st.lists(sequence, min_size=1, max_size=2).map("|".join).map("({})".format) | repeated


@settings(max_examples=400, derandomize=True, deadline=None, database=None)
@given(st.recursive(_ATOMS, _parts, max_leaves=6), st.text("ab.1", max_size=6))
def test_answers_are_those_of_regular_expressions(pattern: str, name: str) -> None:
    """Of Python's, which agree with POSIX on whether the whole name matches."""
    assert _answer(pattern, name) in (re.fullmatch(pattern, name) is not None, None)


def _answer(pattern: str, name: str) -> bool | None:
    """None for parentheses that are too deep, or a quantifier without anything before it."""
    try:
        return matches(pattern, name)
    except ValueError:
        return None


@pytest.mark.parametrize("pattern", ["(a*)*b", "((a+)+)+", ".*" * 40 + "x", "(a|a?)" * 12 + "b"])
def test_patterns_that_explode_elsewhere_do_not_here(pattern: str) -> None:
    """Backtracking would take 2^90 steps."""
    assert not matches(pattern, "a" * 90 + "c")


@pytest.mark.parametrize("pattern", ["(a", "a)", "*a", "[a", "a{2}", "^a", "a$", r"\w", "a" * 101])
def test_other_patterns_are_refused(pattern: str) -> None:
    with pytest.raises(ValueError, match=r"."):
        matches(pattern, "a")
