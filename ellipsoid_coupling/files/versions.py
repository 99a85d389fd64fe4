"""The versions of installed packages."""

from __future__ import annotations

from functools import cache
from importlib import metadata


@cache
def version(package: str) -> str:
    """The version of an installed package; looked up once, which takes a millisecond."""
    return metadata.version(package)
