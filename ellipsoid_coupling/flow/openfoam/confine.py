"""Run one program so that it ends with its parent, and can write nowhere but in one folder.

    python -I -S confine.py PARENT FOLDER PROGRAM ARGUMENTS...     (FOLDER is - for no wall)

A script of its own, on the standard library alone: it is started once for each program of OpenFOAM and
must start in milliseconds. Python runs no code of this package in it between a fork and an exec, which a
parent with threads could not do safely.

It stays beside the program and ends everything that the program has started, other sessions included,
when the program has ended, when PARENT (a process id) has gone, or on a signal.

The wall are namespaces of Linux: a network of its own with nothing but loopback (mpirun needs that),
and a file system that is read-only but for FOLDER and an empty /tmp; /run, where sockets of services
lie, is empty, and /dev holds null, zero, full, random and urandom. Where the system does not let it be
built, the program runs without it, and the first line of its output begins with NO_WALL and says why.
"""

from __future__ import annotations

import contextlib
import ctypes
import fcntl
import os
import shutil
import signal
import socket
import struct
import sys
import time
from pathlib import Path
from typing import NoReturn

NO_WALL = "ellipsoid: this program runs without a wall around it: "
NO_FOLDER = "-"

_POLL_SECONDS = 0.02
# sched.h, mount.h, prctl.h
_NEW_MOUNTS, _NEW_IPC, _NEW_USER, _NEW_NET = 0x20000, 0x8000000, 0x10000000, 0x40000000
_BIND, _RECURSIVE, _SLAVE, _NO_SUID, _NO_DEVICES = 0x1000, 0x4000, 0x80000, 2, 4
_DEATH_SIGNAL, _DROP, _REAPER, _NO_PRIVILEGES, _AMBIENT, _CLEAR_ALL = 1, 24, 36, 38, 47, 4
_MOUNT_SETATTR, _HERE, _WHOLE_TREE, _READ_ONLY = 442, -100, 0x8000, 1
_GET_FLAGS, _SET_FLAGS, _UP = 0x8913, 0x8914, 1
_CAPABILITIES_3, _MOST_CAPABILITIES = 0x20080522, 64
# The capabilities by which root reads and writes others' files in FOLDER; read-only mounts stay so.
_KEPT_CAPABILITIES = (0, 1, 2, 3)
_DEVICES = ("null", "zero", "full", "random", "urandom")
_HIDDEN = ("/tmp", "/run")
_PATHS = ("PATH", "LD_LIBRARY_PATH", "WM_PROJECT_DIR", "OPAL_PREFIX")
_ENDING = (signal.SIGTERM, signal.SIGHUP, signal.SIGINT)
_LINUX = sys.platform == "linux"


def _call(name: str, *arguments: object) -> None:
    """A function of the C library; OSError with its name where it fails."""
    library = ctypes.CDLL(None, use_errno=True)
    if getattr(library, name)(*arguments) < 0:
        number = ctypes.get_errno()
        raise OSError(number, f"{name}: {os.strerror(number)}")


def _prctl(option: int, value: int) -> None:
    _call("prctl", option, *map(ctypes.c_ulong, (value, 0, 0, 0)))


def _mount(source: str, target: str, kind: str | None, flags: int, data: str | None = None) -> None:
    texts = [None if text is None else os.fsencode(text) for text in (source, target, kind, data)]
    _call("mount", *texts[:3], ctypes.c_ulong(flags), texts[3])


def _set_mount(path: str, added: int, removed: int, flags: int) -> None:
    attributes = struct.pack("=QQQQ", added, removed, 0, 0)
    _call(
        "syscall", ctypes.c_long(_MOUNT_SETATTR), ctypes.c_long(_HERE), os.fsencode(path),
        ctypes.c_long(flags), attributes, ctypes.c_long(len(attributes)),
    )  # fmt: skip


def _new_namespaces() -> None:
    """Own mounts, network and shared memory; root needs no user namespace where it is a real one."""
    wanted = _NEW_MOUNTS | _NEW_NET | _NEW_IPC
    user, group = os.geteuid(), os.getegid()
    if user == 0:
        with contextlib.suppress(OSError):
            _call("unshare", wanted)
            return
    _call("unshare", wanted | _NEW_USER)
    Path("/proc/self/setgroups").write_text("deny", encoding="ascii")
    Path("/proc/self/uid_map").write_text(f"{user} {user} 1", encoding="ascii")
    Path("/proc/self/gid_map").write_text(f"{group} {group} 1", encoding="ascii")


def _loopback() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as any_socket:
        (flags,) = struct.unpack_from(
            "16xh", fcntl.ioctl(any_socket, _GET_FLAGS, struct.pack("16s24x", b"lo"))
        )
        fcntl.ioctl(any_socket, _SET_FLAGS, struct.pack("16sh22x", b"lo", flags | _UP))


def _build_wall(folder: str, program: list[str]) -> None:
    """Namespaces in which nothing but `folder` and an empty /tmp can be written.

    program : its names, as it is called and where a link leads
    """
    _new_namespaces()
    _loopback()
    _mount("none", "/", None, _RECURSIVE | _SLAVE)
    inside = os.open(folder, os.O_PATH | os.O_DIRECTORY)
    devices = {name: os.open(f"/dev/{name}", os.O_PATH) for name in _DEVICES}
    # Folders of programs and libraries stay.
    needed = [*program, *(part for key in _PATHS for part in os.environ.get(key, "").split(":"))]
    hidden = [
        path for path in _HIDDEN
        if Path(path).is_dir() and not any(part.startswith(f"{path}/") for part in needed)
    ]  # fmt: skip
    for path in ("/dev", *hidden):
        _mount("tmpfs", path, "tmpfs", _NO_SUID, "mode=0755,size=256m")
    Path("/dev/shm").mkdir()
    _mount("tmpfs", "/dev/shm", "tmpfs", _NO_SUID | _NO_DEVICES, "mode=1777,size=50%")
    Path("/dev/fd").symlink_to("/proc/self/fd")
    for name, handle in devices.items():
        Path(f"/dev/{name}").touch()
        _mount(f"/proc/self/fd/{handle}", f"/dev/{name}", None, _BIND)
    Path(folder).mkdir(parents=True, exist_ok=True)
    _mount(f"/proc/self/fd/{inside}", folder, None, _BIND)
    _set_mount("/", _READ_ONLY | _NO_SUID, 0, _WHOLE_TREE)
    for path in (folder, "/dev/shm", *(path for path in hidden if path == "/tmp")):
        _set_mount(path, 0, _READ_ONLY, 0)
    os.chdir(folder)
    os.environ["TMPDIR"] = "/dev/shm"
    _give_up_rights()


def _give_up_rights() -> None:
    """No capability that could undo the wall, now or by any program started from here."""
    for capability in range(_MOST_CAPABILITIES):
        if capability not in _KEPT_CAPABILITIES:
            with contextlib.suppress(OSError):  # the system has fewer
                _prctl(_DROP, capability)
    _prctl(_AMBIENT, _CLEAR_ALL)
    header, data = struct.pack("=Ii", _CAPABILITIES_3, 0), ctypes.create_string_buffer(24)
    _call("capget", header, data)
    effective, permitted, _, *upper = struct.unpack("=6I", data.raw)
    _call("capset", header, struct.pack("=6I", effective, permitted, 0, *upper[:2], 0))
    _prctl(_NO_PRIVILEGES, 1)


def _heard() -> list[signal.Signals]:
    """The signals that end a program; those that are ignored, as by nohup, stay ignored."""
    return [number for number in _ENDING if signal.getsignal(number) != signal.SIG_IGN]


def _become(folder: str, command: list[str], errors: int) -> NoReturn:
    """The child: build the wall, and become the program; an error is written to the pipe `errors`."""
    for number in _heard():
        signal.signal(number, signal.SIG_DFL)
    try:
        if _LINUX:
            _prctl(_DEATH_SIGNAL, signal.SIGKILL)
        if folder != NO_FOLDER:
            program = Path(shutil.which(command[0]) or command[0]).absolute()
            _build_wall(str(Path(folder).resolve()), [str(program), str(program.resolve())])
    except (OSError, AttributeError) as error:
        os.write(errors, str(error).encode(errors="replace"))
        os._exit(0)
    try:
        os.execvp(command[0], command)
    except OSError as error:
        os.write(2, f"{command[0]}: {error.strerror}\n".encode(errors="replace"))
        os._exit(127)


def _start(folder: str, command: list[str]) -> int:
    """The program as a child, within the wall if it can be built; its process id."""
    hears, tells = os.pipe()
    child = os.fork()
    if child == 0:
        _become(folder, command, tells)
    os.close(tells)
    with os.fdopen(hears, "rb") as pipe:
        why = pipe.read().decode(errors="replace")
    if not why:
        return child
    os.waitpid(child, 0)
    os.write(1, f"{NO_WALL}{why}\n".encode(errors="replace"))
    return _start(NO_FOLDER, command)


def _descendants() -> list[int]:
    """Processes of this session, and those that have fallen to this process as their parent."""
    own, pids = os.getpid(), []
    for path in Path("/proc").glob("[0-9]*/stat"):
        with contextlib.suppress(OSError, ValueError):
            # "pid (name) state parent group session ...": a name may hold anything.
            fields = path.read_text(encoding="latin-1").rpartition(")")[2].split()
            pid = int(path.parent.name)
            if pid != own and fields[0] != "Z" and own in (int(fields[1]), int(fields[3])):
                pids.append(pid)
    return pids


def _end_all(child: int) -> None:
    """Kill the program and everything that it has started."""
    with contextlib.suppress(ProcessLookupError):
        os.kill(child, signal.SIGKILL)
    for _ in range(100):  # those whose parent dies come to this process, and are found next time
        with contextlib.suppress(ChildProcessError):
            while os.waitpid(-1, os.WNOHANG) != (0, 0):
                pass
        left = _descendants()
        for pid in left:
            with contextlib.suppress(ProcessLookupError, PermissionError):
                os.kill(pid, signal.SIGKILL)
        if not left:
            return
        time.sleep(_POLL_SECONDS)


def _leave(number: int, _frame: object) -> NoReturn:
    sys.exit(128 + number)


def main(parent: int, folder: str, command: list[str]) -> int:
    """Run the command; its exit status, 128 + its signal if one ended it."""
    for number in _heard():
        signal.signal(number, _leave)
    if _LINUX:
        _prctl(_DEATH_SIGNAL, signal.SIGTERM)
        _prctl(_REAPER, 1)
    child = _start(folder, command)
    try:
        while os.getppid() == parent:
            pid, status = os.waitpid(-1, os.WNOHANG)
            if pid == child:
                code = os.waitstatus_to_exitcode(status)
                return code if code >= 0 else 128 - code
            if pid == 0:
                time.sleep(_POLL_SECONDS)
        return 128 + signal.SIGTERM
    finally:
        for number in _ENDING:
            signal.signal(number, signal.SIG_IGN)
        _end_all(child)


if __name__ == "__main__":
    sys.exit(main(int(sys.argv[1]), sys.argv[2], sys.argv[3:]))
