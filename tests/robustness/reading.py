"""A process of its own that reads cases, so that a crash of VTK would be seen and not suffered."""

from __future__ import annotations

import multiprocessing
import resource
from multiprocessing.connection import Connection
from pathlib import Path

SECONDS = 10
MEMORY = 4_000_000_000


def _serve(connection: Connection) -> None:
    """Answer each path with "" for a finite flow, with the InputError's text, or with what else came."""
    import numpy as np

    from ellipsoid_coupling.errors import InputError
    from ellipsoid_coupling.flow.provide import flow_at

    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    connection.send("ready")
    while (path := connection.recv()) is not None:
        try:
            arrays = flow_at(path).arrays
            finite = np.isfinite(arrays.coefficients).all() and np.isfinite(arrays[1:9]).all()
            connection.send("" if finite else "a flow that is not finite")
        except InputError as error:
            connection.send(f"refused: {error}")
        except BaseException as error:
            connection.send(f"{type(error).__name__}: {error}")


class Worker:
    """Reads one path after another in its process."""

    def __init__(self) -> None:
        context = multiprocessing.get_context("spawn")
        self._ours, theirs = context.Pipe()
        self._process = context.Process(target=_serve, args=(theirs,), daemon=True)
        self._process.start()
        theirs.close()
        assert self._ours.poll(120)  # imports
        assert self._ours.recv() == "ready"

    def read(self, path: Path) -> str:
        """The answer for a path; AssertionError if the process ends or takes longer than 10 s."""
        self._ours.send(path)
        assert self._ours.poll(SECONDS), f"more than {SECONDS} s"
        try:
            return str(self._ours.recv())
        except EOFError:
            raise AssertionError("the reading process has ended") from None

    def close(self) -> None:
        """End the process."""
        self._process.terminate()
        self._process.join()
        self._ours.close()
