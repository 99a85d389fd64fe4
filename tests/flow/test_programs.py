"""Running a program: its log is followed while it runs and quoted when it fails."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from ellipsoid_coupling.errors import RunError
from ellipsoid_coupling.flow.programs import LAST_LINES, run_program


def test_the_log_is_followed(tmp_path: Path) -> None:
    seen: list[str] = []
    program = "import time\nfor k in range(3):\n    print(k, flush=True)\n    time.sleep(0.15)"
    log = run_program(tmp_path, [sys.executable, "-c", program], seen.append)
    assert "".join(seen).split() == ["0", "1", "2"]
    assert len([part for part in seen if part]) > 1
    assert log.read_text(encoding="utf-8").split() == ["0", "1", "2"]


def test_a_failure_quotes_the_last_lines(tmp_path: Path) -> None:
    program = "for k in range(100): print('line', k)\nraise SystemExit(3)"
    with pytest.raises(RunError, match="ended with status 3") as caught:
        run_program(tmp_path, [sys.executable, "-c", program])
    text = str(caught.value)
    assert "line 99" in text
    assert text.count("line ") == LAST_LINES
    assert str(tmp_path) in text
