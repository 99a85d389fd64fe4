"""The scanner: every kind of token, comments and their places, nothing swallowed, linear."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ellipsoid_coupling.flow.openfoam.tokens import (
    after_space,
    line_of,
    name_at,
    token_at,
    tokens,
    without_comments,
)

TEXT = b"""cells  $n ;  // comment " { #{
valueExpr "vector(x, \\"0\\", 0) // no comment"; /* " */
code #{ int i; /* #}; #include "parameters" ${a.b}c 2d_wall frt:001%1 [0 1]
"""


def test_every_kind_of_token() -> None:
    found = [(token.kind, token.text) for token in tokens(TEXT)]
    assert found == [
        ("word", "cells"), ("variable", "$n"), ("mark", ";"),
        ("word", "valueExpr"), ("string", '"vector(x, \\"0\\", 0) // no comment"'), ("mark", ";"),
        ("word", "code"), ("verbatim", "#{ int i; /* #}"), ("mark", ";"),
        ("directive", "#include"), ("string", '"parameters"'), ("variable", "${a.b}c"),
        ("word", "2d_wall"), ("word", "frt:001%1"),
        ("mark", "["), ("word", "0"), ("word", "1"), ("mark", "]"),
    ]  # fmt: skip


@pytest.mark.parametrize("odd", [b"/* never ends", b'"never ends', b"#{ never ends", b"\\", b"\0"])
def test_what_never_ends_is_odd_and_the_last(odd: bytes) -> None:
    """An unclosed comment was swallowed by Python 3.11.2, and what it hid with it."""
    kinds = [token.kind for token in tokens(b"a " + odd + b" b")]
    assert kinds == ["word", "odd"]
    assert without_comments(b"a " + odd + b" // b") in (
        b"a " + odd + b" // b",
        b"a " + odd + b"     ",
    )


@pytest.mark.parametrize(
    ("text", "name"),
    [
        (b"in(1) {", "in(1)"), (b"div(phi,U) ;", "div(phi,U)"), (b"a(b(c))d{", "a(b(c))d"),
        (b"wall ( x", "wall"), (b"a(b {", "a"), (b"3(0 0", "3"), (b"%,+=~@& {", "%,+=~@&"),
    ],
)  # fmt: skip
def test_names_may_have_parentheses_that_close(text: bytes, name: str) -> None:
    token = name_at(text, 0)
    assert token is not None
    assert (token.kind, token.text) == ("word", name)


def test_comments_leave_blanks_in_their_place() -> None:
    plain = without_comments(TEXT)
    assert len(plain) == len(TEXT)
    assert plain.count(b"\n") == TEXT.count(b"\n")
    assert [t[:2] for t in tokens(plain)] == [t[:2] for t in tokens(TEXT)]
    assert b'comment "' not in plain
    assert line_of(TEXT, TEXT.index(b"code")) == 3


@settings(max_examples=300, derandomize=True, deadline=None, database=None)
@given(st.lists(st.sampled_from([b"/", b"*", b"//", b"/*", b"*/", b'"', b"\\", b"#{", b"#}", b"#a",
                                 b"$", b"{", b"}", b"(", b"a", b"\n", b" ", b"\xff"])))  # fmt: skip
def test_any_text_is_read_once_and_in_order(parts: list[bytes]) -> None:
    """Tokens cover everything but blanks and comments; without comments they are the same ones."""
    data = b"".join(parts)
    at, kind = 0, "none"
    for token in tokens(data):
        assert token.start == after_space(data, at)
        assert token.end > token.start
        assert token_at(data, at) == token
        at, kind = token.end, token.kind
    if kind != "odd":
        assert after_space(data, at) == len(data)
    assert [t[:2] for t in tokens(without_comments(data))] == [t[:2] for t in tokens(data)]


def test_long_odd_text_is_read_in_one_go() -> None:
    """A megabyte of openings: quadratic reading would take hours."""
    for part in (b'\\"', b"/", b"#", b"${", b"a(", b"/*/"):
        data = b'"' * (part[:1] == b"\\") + part * 1_000_000
        assert len(list(tokens(data[:100_000]))) <= 100_001
        assert len(without_comments(data)) == len(data)
        name_at(data, 0)
