"""Closed, full and unread streams, and what numba's own settings break: one line, the right status."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from ellipsoid_coupling.cli import main
from ellipsoid_coupling.compiled import threading_layer
from ellipsoid_coupling.errors import InputError

COMMAND = f"{sys.executable} -m ellipsoid_coupling"
PLAN = f"{COMMAND} plan"


def in_shell(command: str, **changed: str) -> tuple[int, str, list[str]]:
    """Exit status (of all parts of a pipe), standard output and what is told on standard error."""
    done = subprocess.run(
        ["/bin/bash", "-o", "pipefail", "-c", command],
        env=os.environ | changed,
        capture_output=True,
        text=True,
        check=False,
    )
    told = [line for line in done.stderr.splitlines() if not line.endswith(" ...")]
    return done.returncode, done.stdout, told


@pytest.mark.parametrize(
    ("command", "status", "told"),
    [
        ("--version >&-", 0, 0),
        ("plan cavity <&- >&- 2>&-", 0, 0),
        ("--nothing 2>&-", 2, 0),
        ("plan nothing >&-", 2, 1),
        ("--version | true", 0, 0),
        ("--nothing 2>&1 >/dev/null | true", 2, 0),
        ("--version >/dev/full", 1, 1),
    ],
)
def test_streams_that_take_nothing(command: str, status: int, told: int) -> None:
    """Who closes a stream does not want to read it; only a full disk is a failure to tell.

    All commands are written through the same streams; those that load next to nothing do for most.
    """
    found, out, lines = in_shell(f"{COMMAND} {command}")
    assert (found, out, len(lines)) == (status, "", told)


def test_help_that_nobody_reads_to_its_end() -> None:
    assert in_shell(f"{PLAN} --help | true") == (0, "", [])


def test_a_closed_stream_leaves_its_number_to_no_file(tmp_path: Path) -> None:
    """Else what is printed would go into the first file that is opened."""
    code = (
        "import os, sys; from ellipsoid_coupling.output.streams import open_streams; open_streams(); "
        f"handle = os.open({str(tmp_path / 'file')!r}, os.O_CREAT | os.O_WRONLY); "
        "print('lost', flush=True); os.write(handle, str(handle).encode())"
    )
    assert in_shell(f'{sys.executable} -c "{code}" <&- >&- 2>&-')[0] == 0
    assert int((tmp_path / "file").read_text()) > 2


@pytest.mark.parametrize(
    ("name", "value", "told"),
    [
        ("NUMBA_NUM_THREADS", "0", "a whole number, 1 or more, at most 100000, found '0'"),
        ("NUMBA_NUM_THREADS", "-1", "found '-1'"),
        ("NUMBA_NUM_THREADS", "x", "found 'x'"),
        ("NUMBA_NUM_THREADS", "1.5", "found '1.5'"),
        ("NUMBA_NUM_THREADS", "100001", "found '100001'"),
        ("NUMBA_NUM_THREADS", "9" * 5000, "9 ... 9"),
        ("NUMBA_THREADING_LAYER", "fast", "one of default, tbb, omp, workqueue"),
    ],
)
def test_settings_of_numba_that_it_does_not_know(
    name: str,
    value: str,
    told: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setenv(name, value)
    with pytest.raises(SystemExit) as ended:
        main(["plan", "cavity"])
    assert ended.value.code == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(f"ellipsoid: {name}: expected ")
    assert told in line
    assert len(line) < 1_000


@pytest.mark.parametrize(
    ("name", "value"), [("NUMBA_OPT", "foo"), ("NUMBA_LOOP_VECTORIZE", "x\ny")]
)
def test_a_variable_that_numba_cannot_read_is_told_in_one_line(name: str, value: str) -> None:
    """Numba itself warns of it with a trace, when it is imported."""
    status, _, told = in_shell(f"{COMMAND} models", **{name: value})
    assert status == 0
    (line,) = told
    assert line.startswith(f"ellipsoid: Environment variable '{name}' is defined but its")
    assert line.endswith("could not be parsed. It is not used; change or unset it.")


def test_a_threading_layer_that_is_not_installed(monkeypatch: pytest.MonkeyPatch) -> None:
    """Whichever that is: numba's answer to it is made up here."""

    class Parallel:
        @staticmethod
        def _launch_threads() -> None:
            raise ValueError("No threading layer could be loaded.\nHINT:\nconda install tbb")

    monkeypatch.setattr(threading_layer, "_numba", Parallel)
    monkeypatch.setenv("NUMBA_THREADING_LAYER", "tbb")
    threading_layer.layer.cache_clear()
    with pytest.raises(InputError, match=r"LAYER=tbb: .*could be loaded\. Unset it") as caught:
        threading_layer.layer()
    assert "\n" not in str(caught.value)
    monkeypatch.undo()
    threading_layer.layer.cache_clear()


def test_it_is_told_before_anything_is_computed() -> None:
    """By the command, with a layer that no Linux machine has on its own: that of the safe kind."""
    status, out, told = in_shell(f"{PLAN} cavity", NUMBA_THREADING_LAYER="safe")
    if status:  # tbb is not installed
        assert (status, out, len(told)) == (2, "", 1)
        assert told[0].startswith("ellipsoid: NUMBA_THREADING_LAYER=safe: expected")
