"""Numba's cache of compiled kernels, without those that hold what comes from outside of the package."""

from __future__ import annotations

from typing import Any

from numba.core import caching

# Numba ships half of its types: this class has none.
_FunctionCache: Any = caching.FunctionCache

# Types whose formulas come from outside of the package, see `leave_uncached`.
_uncached: set[type[Any]] = set()


def leave_uncached(kind: type[Any]) -> None:
    """Compile whatever takes an argument of type `kind`, a NamedTuple, anew in every session."""
    _uncached.add(kind)


def _is_uncached(kind: Any) -> bool:
    """Whether a type of numba's is one of these, or holds one."""
    return getattr(kind, "instance_class", None) in _uncached or any(
        map(_is_uncached, getattr(kind, "types", ()))
    )


def _goes_to_disk(signature: Any) -> bool:
    return not any(map(_is_uncached, getattr(signature, "args", signature)))


def _load(cache: Any, signature: Any, context: Any) -> Any:
    return (
        _FunctionCache.load_overload(cache, signature, context)
        if _goes_to_disk(signature)
        else None
    )


def _save(cache: Any, signature: Any, result: Any) -> None:
    if _goes_to_disk(signature):
        _FunctionCache.save_overload(cache, signature, result)


KernelCache: Any = type(
    "KernelCache", (_FunctionCache,), {"load_overload": _load, "save_overload": _save}
)
