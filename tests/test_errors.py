"""What errors show: one readable line, whatever is quoted in it."""

from __future__ import annotations

import pytest

from ellipsoid_coupling.cli import main
from ellipsoid_coupling.errors import EllipsoidError, InputError, RunError, WriteError, shown

# Bytes that are no UTF-8 (as Python names them), colours, a bell, writing from right to left, C1.
NASTY = "a\udcff\x1b[31m\x07\u202e\x9bz"


@pytest.mark.parametrize("kind", [EllipsoidError, RunError, WriteError])
def test_no_failure_steers_the_terminal(kind: type[EllipsoidError]) -> None:
    """Exactly: printable text and line ends stay as they are, everything else is an escape."""
    text = str(kind(f"end of log:\n{NASTY} Ω"))
    assert text == "end of log:\na\\udcff\\x1b[31m\\x07\\u202e\\x9bz Ω"
    assert text.encode("utf-8")


def test_input_errors_are_one_line_of_printable_text() -> None:
    error = InputError(NASTY, f"x\n{NASTY}", "y" * 10_000, NASTY)
    assert str(error).isprintable()
    assert len(str(error)) < 2_000
    assert error.where == shown(NASTY)


@pytest.mark.parametrize("argument", [NASTY, f"--{NASTY}"])
def test_what_the_command_line_quotes_is_shown(
    argument: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as caught:
        main([argument])
    assert caught.value.code == 2
    told = capsys.readouterr().err
    assert "\\x1b" in told
    assert all(c.isprintable() or c == "\n" for c in told)
