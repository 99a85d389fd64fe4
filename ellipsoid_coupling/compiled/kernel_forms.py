"""The two forms of a kernel: called from Python, and taken in by the kernels that call it.

Numba alone optimises every kernel and translates it to machine code, even where only other kernels call
it; each of these takes its instructions in, optimises and translates them once more. Here what is taken in
stays as numba wrote it down, and LLVM works on a kernel's instructions once for each caller in Python.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import llvmlite.binding as llvm
from numba.core import caching, codegen, compiler, registry, types
from numba.core.typing import templates

from ellipsoid_coupling.compiled.kernel_cache import KernelCache

# Numba ships half of its types: these classes have none.
_Dispatcher: Any = registry.CPUDispatcher
_Library: Any = codegen.JITCodeLibrary
_Result: Any = compiler.CompileResult
_ResultCache: Any = caching.CompileResultCacheImpl
_parse: Any = llvm.parse_bitcode
_make_template: Any = templates.make_overload_template
_register: Any = templates.infer_global

# Strict floating point. With re-association or contraction the compiler rounds as it likes, and not
# alike in a process that compiles a kernel and in one that loads it from the cache: the linker may
# then choose another copy of an inner kernel. Sums whose order may be free are written in lanes, and
# fused multiply-adds as `intrinsics.fma`, so that this costs little.
OPTIONS: dict[str, Any] = {"nopython": True, "error_model": "numpy", "fastmath": False}

# What is taken in: a library of instructions, without machine code.


def _end(library: Any) -> None:
    library._finalize_dynamic_globals()
    library._finalized = True


def _to_bytes(library: Any) -> bytes:
    library._ensure_finalized()
    code: bytes = library._final_module.as_bitcode()
    return code


_Instructions: Any = type(
    "_Instructions",
    (_Library,),
    {
        "_optimize_final_module": lambda _library: None,
        "_finalize_final_module": _end,
        "serialize_using_object_code": _to_bytes,
    },
)


def _from_bytes(_cache: Any, context: Any, parts: Any) -> Any:
    code, description, environment, signature, _, _, annotation, again, environments = parts
    library = _Instructions(context.codegen(), description.qualname)
    library._final_module = _parse(code)
    library._finalize_final_module()
    return _Result(
        target_context=context,
        typing_context=context.typing_context,
        library=library,
        environment=environment,
        entry_point=object(),  # numba finds it by that
        fndesc=description,
        type_annotation=annotation,
        signature=signature,
        objectmode=False,
        lifted=(),
        typing_error=None,
        call_helper=None,
        metadata=None,
        reload_init=again,
        referenced_envs=environments,
    )


def _file_name(cache: Any, name: str, flags: str) -> str:
    return "instructions-" + str(_ResultCache.get_filename_base(cache, name, flags))


_InstructionsCache: Any = type(
    "_InstructionsCache",
    (KernelCache,),
    {
        "_impl_class": type(
            "_Impl",
            (_ResultCache,),
            {"rebuild": _from_bytes, "get_filename_base": _file_name},
        )
    },
)


def _without_machine_code(passes: Any) -> Any:
    def define_pipelines(pipeline: Any) -> Any:
        state = pipeline.state
        state.flags.no_cpython_wrapper = True
        state.flags.no_cfunc_wrapper = True
        state.flags.no_compile = True
        state.library = _Instructions(state.targetctx.codegen(), state.func_id.func_qualname)
        return passes.define_pipelines(pipeline)

    return type("_WithoutMachineCode", (passes,), {"define_pipelines": define_pipelines})


def _keep_taken_in(dispatcher: Any, result: Any) -> None:
    if result.entry_point is None:
        result = result._replace(entry_point=object())
        dispatcher.targetctx.insert_user_function(
            result.entry_point, result.fndesc, [result.library]
        )
    dispatcher.overloads[tuple(result.signature.args)] = result


_TakenIn: Any = type("_TakenIn", (_Dispatcher,), {"add_overload": _keep_taken_in})


def _keep_called(dispatcher: Any, result: Any) -> None:
    _Dispatcher.add_overload(dispatcher, result)
    # Numba does this where it compiles a kernel to machine code: here for all that were taken in.
    for environment in result._find_referenced_environments():
        result.codegen.set_env(environment.env_name, environment)


_Called: Any = type(
    "_Called",
    (_Dispatcher,),
    {
        "add_overload": _keep_called,
        "get_call_template": lambda self, *given: self.taken_in.get_call_template(*given),
        "get_overload": lambda self, signature: self.taken_in.get_overload(signature),
    },
)


def _taken_in(function: Callable[..., Any], passes: Any, options: dict[str, Any]) -> Any:
    return _TakenIn(
        function, targetoptions=dict(options), pipeline_class=_without_machine_code(passes)
    )


def two_forms(function: Callable[..., Any], passes: Any, options: dict[str, Any]) -> Any:
    """The kernel of `function`: calls from Python compile one form, calls from kernels the other.

    Parameters
    ----------
    passes : a subclass of numba's compiler
    options : beside `OPTIONS`, as for `numba.njit`
    """
    options = OPTIONS | options
    made = _Called(function, targetoptions=dict(options), pipeline_class=passes)
    made._cache = KernelCache(function)
    made.taken_in = _taken_in(function, passes, options)
    made.taken_in._cache = _InstructionsCache(function)
    return made


def in_kernels(
    function: Callable[..., Any], *, inlined: bool = True, cached: bool = False
) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Decorate what chooses, by the types of its arguments, the function that kernels call for `function`.

    Like `numba.extending.overload`, which would make machine code of it.

    Parameters
    ----------
    inlined : bool
        Whether its Python code stands in the caller's before types are found.
    cached : bool
        Whether it goes into the cache: of a function of a module.
    """

    def take_in(chosen: Callable[..., Any]) -> Any:
        made = _taken_in(chosen, compiler.Compiler, OPTIONS)
        if cached:
            made._cache = _InstructionsCache(chosen)
        return made

    def decorate(choose: Callable[..., Any]) -> Callable[..., Any]:
        template = _make_template(function, choose, {}, False, "always" if inlined else "never")
        template._get_jit_decorator = lambda _template: lambda: take_in
        _register(function, types.Function(template))
        return choose

    return decorate
