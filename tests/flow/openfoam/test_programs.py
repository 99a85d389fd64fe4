"""Running a program: its log is followed, it ends with its parent, and a wall stands around it."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from ellipsoid_coupling.errors import RunError
from ellipsoid_coupling.flow.openfoam import confine, programs
from ellipsoid_coupling.flow.openfoam.programs import LAST_LINES, run_program, says, why_open
from ellipsoid_coupling.flow.openfoam.solve import solve_case
from ellipsoid_coupling.flow.openfoam.solved_cases import case_folder
from tests.flow.openfoam.installed import needs_openfoam

# A test that waits for another process gives up after so long; it takes tenths of a second.
PATIENCE = 120.0


def wait_until(true: Callable[[], bool], what: str) -> None:
    end = time.monotonic() + PATIENCE
    while not true():
        if time.monotonic() > end:
            pytest.fail(f"waited in vain until {what}")
        time.sleep(0.02)


def lives(pid: int) -> bool:
    try:
        stat = Path(f"/proc/{pid}/stat").read_text(encoding="latin-1")
    except OSError:
        return False
    return stat.rpartition(")")[2].split()[0] != "Z"


def working_in(folder: Path) -> list[int]:
    """Processes whose folder is `folder` or one in it."""
    found = []
    for link in Path("/proc").glob("[0-9]*/cwd"):
        try:
            place = link.readlink()
        except OSError:
            continue
        if place.is_relative_to(folder):
            found.append(int(link.parent.name))
    return found


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


def test_a_program_that_says_too_much_is_ended(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(programs, "MOST_LOG_BYTES", 100_000)
    with pytest.raises(RunError, match=r"yes said more than 100 kB\. The end of ") as caught:
        run_program(tmp_path, ["yes", "no"])
    assert str(caught.value).count("no") > LAST_LINES // 2
    wait_until(lambda: not working_in(tmp_path), "no process works there any more")
    assert says(tmp_path / "log.yes", "no")
    assert not says(tmp_path / "log.yes", "yes")


def test_a_run_that_has_diverged_is_told_without_its_stack(tmp_path: Path) -> None:
    frames = "#3  Foam::PCG::solve(a) at ??:?", "[host:405] [ 5] icoFoam(+0x23b15)[0x5577]"
    program = f"echo Time = 3; echo '{frames[0]}'; echo '{frames[1]}'; kill -8 $$"
    with pytest.raises(RunError, match=r"status 136, .* diverged; a smaller deltaT") as caught:
        run_program(tmp_path, ["sh", "-c", program])
    assert str(caught.value).splitlines()[1:] == ["    Time = 3"]


@pytest.mark.parametrize(("program", "status"), [("kill -9 $$", 137), ("exec /no/such", 127)])
def test_every_other_end_is_told(tmp_path: Path, program: str, status: int) -> None:
    with pytest.raises(RunError, match=f"ended with status {status}"):
        run_program(tmp_path, ["sh", "-c", program])
    with pytest.raises(RunError, match="no_such_program: No such file"):
        run_program(tmp_path, ["no_such_program"])


def test_the_wall_lets_nothing_out(tmp_path: Path) -> None:
    """Within its folder a program writes; elsewhere, in /tmp or not, and to the network it does not."""
    case, other = tmp_path / "case", tmp_path / "other"
    case.mkdir()
    other.mkdir()
    beside = Path(__file__).with_name(".written")
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
        program = (
            "import pathlib, socket\n"
            "pathlib.Path('own').write_text('1')\n"
            f"for name in ({str(other / 'x')!r}, {str(beside)!r}):\n"
            "    try:\n"
            "        pathlib.Path(name).write_text('1')\n"
            "    except OSError as error:\n"
            "        print(error.strerror)\n"
            "try:\n"
            f"    socket.create_connection(('127.0.0.1', {port}))\n"
            "except OSError as error:\n"
            "    print(error.strerror)\n"
        )
        log = run_program(case, [sys.executable, "-c", program])
    if why := why_open(log):
        beside.unlink(missing_ok=True)
        pytest.skip(f"this system has no such wall: {why}")
    assert (case / "own").is_file()
    assert not (other / "x").exists()
    assert not beside.exists()
    assert log.read_text("utf-8").splitlines()[1:] == [
        "Read-only file system",
        "Connection refused",
    ]


def test_where_there_is_no_wall_the_program_runs_and_the_log_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As on a system whose C library knows no mount: the script is the package's but for that name."""
    script = tmp_path / "confine.py"
    text = Path(confine.__file__).read_text("utf-8")
    script.write_text(text.replace('_call("mount"', '_call("no_such_mount"'), "utf-8")
    monkeypatch.setattr(confine, "__file__", str(script))
    log = run_program(tmp_path, ["sh", "-c", "echo done"])
    assert log.read_text("utf-8").splitlines()[1] == "done"
    assert why_open(log)
    assert why_open(run_program(tmp_path, ["sh", "-c", "echo done"], walled=False)) == ""


# Starts a program that starts others: one in the background, one in a session of its own.
TREE = (
    "sleep 3600 & echo $! >one; setsid sh -c 'echo $$ >other; exec sleep 3600' & echo $$ >own; wait"
)


@pytest.fixture
def parent(tmp_path: Path) -> Iterator[subprocess.Popen[bytes]]:
    script = (
        "import pathlib\nfrom ellipsoid_coupling.flow.openfoam.programs import run_program\n"
        f"run_program(pathlib.Path('.'), ['sh', '-c', {TREE!r}])"
    )
    process = subprocess.Popen([sys.executable, "-c", script], cwd=tmp_path)
    yield process
    process.kill()
    process.wait()


@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP, signal.SIGINT, signal.SIGKILL])
@pytest.mark.usefixtures("obeyed")
def test_children_end_with_their_parent(
    tmp_path: Path, parent: subprocess.Popen[bytes], number: int
) -> None:
    files = [tmp_path / name for name in ("one", "other", "own")]
    wait_until(
        lambda: all(f.is_file() and f.read_text().strip() for f in files), "all have started"
    )
    children = [int(file.read_text()) for file in files]
    assert all(lives(child) for child in children)
    parent.send_signal(number)
    parent.wait()
    wait_until(lambda: not any(lives(child) for child in children), "all have ended")
    wait_until(lambda: not working_in(tmp_path), "nobody works there")


@pytest.mark.openfoam
@needs_openfoam
@pytest.mark.parametrize(
    ("number", "processes"),
    [(signal.SIGTERM, 1), (signal.SIGHUP, 2), (signal.SIGKILL, 2)],
)
@pytest.mark.usefixtures("obeyed")
def test_a_killed_command_leaves_neither_solver_nor_folder(
    own_cache: Path, number: int, processes: int
) -> None:
    """The folder of one that had no time to clean up goes with the next command."""
    if processes > (os.cpu_count() or 1):
        pytest.skip("one core")
    command = [sys.executable, "-m", "ellipsoid_coupling", "flow"]
    arguments = ["cavity", "--cells", "79", "--processes", str(processes)]
    process = subprocess.Popen(
        command + arguments, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )

    def solver_runs() -> bool:
        logs = own_cache.glob("flows/.*/log.icoFoam")
        return any("Time = " in log.read_text("utf-8") for log in logs)

    wait_until(lambda: solver_runs() or process.poll() is not None, "icoFoam runs")
    process.send_signal(number)
    assert process.wait() == -number
    wait_until(lambda: not working_in(own_cache), "nobody works there")
    if number == signal.SIGKILL:
        assert list((own_cache / "flows").iterdir())
        solve_case("cavity", 8)
        (left,) = (own_cache / "flows").iterdir()
        assert left.name.startswith("cavity-8-")
    else:
        assert not list((own_cache / "flows").iterdir())


@pytest.mark.openfoam
@needs_openfoam
def test_two_commands_at_once_both_solve_the_same_flow(own_cache: Path) -> None:
    command = [sys.executable, "-m", "ellipsoid_coupling", "flow", "cavity", "--cells", "24"]
    both = [subprocess.Popen(command, stdout=subprocess.PIPE, text=True) for _ in range(2)]
    said = [process.communicate()[0] for process in both]
    assert [process.returncode for process in both] == [0, 0]
    (left,) = (own_cache / "flows").iterdir()
    assert [Path(text.strip().splitlines()[-1]) for text in said] == [left, left]
    assert case_folder("cavity").is_dir()
