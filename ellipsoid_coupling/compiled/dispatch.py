"""Functions whose formula is chosen by the type of their first argument, in kernels while compiling.

A kind of flux, potential, boundary or closure is a NamedTuple (its parameters) and a formula:

    @chosen_by_type
    def outer_force(potential, x, y):
        "-grad V1 at a place."

    class Harmonic(NamedTuple):
        stiffness: float

    @inline_kernel
    def _harmonic_force(potential, x, y):
        return -potential.stiffness * x, -potential.stiffness * y

    register_formula(outer_force, Harmonic, _harmonic_force)

A kernel calls ``outer_force(potential, x, y)`` and is compiled with the formula of that type inlined.
A formula for `type(None)` is what an absent part does, one for `float` what a plain number stands for.
What is registered from outside of the package is compiled anew in every session: numba's cache would not
notice that its file has changed.
"""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable, Sequence
from typing import Any, TypeVar, cast

from numba.core import types

from ellipsoid_coupling.compiled.kernel_cache import leave_uncached
from ellipsoid_coupling.compiled.kernel_forms import in_kernels

Function = TypeVar("Function", bound=Callable[..., Any])

_PACKAGE = __name__.partition(".")[0]
_ABSENT = type(None)


def _kind_of(numba_type: Any) -> Any:
    """The Python type that a kernel's argument has: a NamedTuple, float, or that of None; else None."""
    if isinstance(numba_type, types.NoneType):
        return _ABSENT
    if isinstance(numba_type, types.Float):
        return float
    return getattr(numba_type, "instance_class", None)


def chosen_by_type(declared: Function) -> Function:
    """A function that has a formula for each registered type of its first argument; it has no body.

    Raises TypeError, naming the known types, when called with another one.
    """
    formulas: dict[type[Any], Callable[..., Any]] = {}

    @functools.wraps(declared)
    def call(first: Any, *others: Any) -> Any:
        require_formula(call, first)
        return formulas[type(first)](first, *others)

    vars(call)["formulas"] = formulas
    return cast(Function, call)


def require_formula(function: Callable[..., Any], first: Any) -> None:
    """TypeError, naming the known types, unless `function` has a formula for the type of `first`."""
    formulas: dict[type[Any], Callable[..., Any]] = vars(function)["formulas"]
    if type(first) not in formulas:
        known = ", ".join(kind.__name__ for kind in formulas if kind is not _ABSENT) or "none"
        raise TypeError(
            f"{function.__name__} is not known for {type(first).__name__}, but for {known}"
        )


def require_arguments(formula: Callable[..., Any], expected: Sequence[str]) -> None:
    """TypeError unless a formula takes so many arguments; it may have names of its own for them."""
    source: Any = getattr(formula, "py_func", formula)
    found = tuple(inspect.signature(source).parameters)
    if len(found) != len(expected):
        raise TypeError(
            f"{source.__name__}: expected the arguments ({', '.join(expected)}), "
            f"found ({', '.join(found)})"
        )


def register_formula(
    function: Callable[..., Any], kind: type[Any], formula: Callable[..., Any]
) -> None:
    """Make `formula` what `function` does for a first argument of type `kind`; see `chosen_by_type`.

    Parameters
    ----------
    kind : a NamedTuple, float, or type(None)
    formula : an inline kernel, or a Python function that numba can compile

    Raises
    ------
    ValueError
        If that type has a formula already.
    TypeError
        If the formula takes another number of arguments.
    """
    require_arguments(formula, tuple(inspect.signature(function).parameters))
    formulas: dict[type[Any], Callable[..., Any]] = vars(function)["formulas"]
    if kind in formulas:
        raise ValueError(f"{function.__name__} has a formula for {kind.__name__} already")
    source: Any = getattr(formula, "py_func", formula)
    formulas[kind] = formula
    if any(one.__module__.partition(".")[0] != _PACKAGE for one in (kind, source)):
        leave_uncached(kind)

    def choose(first: Any, *others: Any) -> Any:
        del others
        return source if _kind_of(first) is kind else None

    # Numba looks at the names of the arguments.
    vars(choose)["__signature__"] = inspect.signature(source)
    in_kernels(function)(choose)


def compile_choice(declared: Callable[..., Any], formula: Callable[..., Any]) -> None:
    """Compile ``declared(kinds, number, argument)`` as ``formula(kinds[number], argument)``.

    Kinds of several types stand in one tuple, and which one it is shows while the kernel runs: each is
    compiled, and they are asked for one after the other.

    formula : an inline kernel
    """

    def choose(kinds: Any, number: Any, argument: Any) -> Any:
        del number, argument
        if len(kinds) == 1:

            def only(kinds: Any, number: Any, argument: Any) -> Any:  # noqa: ARG001
                return formula(kinds[0], argument)

            return only

        def first(kinds: Any, number: Any, argument: Any) -> Any:
            if number == 0:
                return formula(kinds[0], argument)
            return declared(kinds[1:], number - 1, argument)

        return first

    in_kernels(declared, inlined=False)(choose)
