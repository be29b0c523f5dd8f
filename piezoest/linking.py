"""One machine code for a whole loop: the functions that it is made of are not compiled by themselves.

Numba optimises every function alone, makes machine code of it, puts it into its caller, optimises that, and
so on, up to the loop that Python calls. A controller is made of 550 functions, and half of the time that it
takes to compile goes into code that never runs. Within `whole`, a function without an entry for Python stays
as it is; the loop takes in all functions below it and is optimised as one. The results are the same to the
last bit.

This works with the inside of Numba, for which pyproject.toml bounds its versions.
"""

import contextlib
from collections.abc import Iterator
from typing import Any

from llvmlite.binding import Linkage
from numba import _dynfunc
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler_lock import global_compiler_lock
from numba.core.cpu import CPUContext

# Untyped: they have methods that their classes do not show to a type checker.
_Context: Any = CPUContext
_lock: Any = global_compiler_lock
_Library: Any = JITCodeLibrary


class _Part(_Library):  # type: ignore[misc]
    """Code of a function that only other compiled ones call: neither optimised nor machine code."""

    def _get_module_for_linking(self: Any) -> Any:
        """Return the code with all that it calls, for a caller that is compiled elsewhere."""
        if self._shared_module is None:
            _take_in(self)
            self._shared_module = self._final_module
        return self._shared_module


def _become_part(library: Any) -> None:
    library.__class__ = _Part
    library._finalized = True
    # Several callers may take it in: one copy is kept. Names that are no longer used go.
    for function in library._final_module.functions:
        if not function.is_declaration and function.linkage == Linkage.external:
            function.linkage = "linkonce_odr"


def _below(library: Any) -> list[Any]:
    """Libraries that a library calls, and those that their parts call, each once."""
    found: dict[Any, None] = {}
    new = [library]
    while new:
        for called in new.pop()._linking_libraries:
            if called not in found:
                found[called] = None
                if isinstance(called, _Part):
                    new.append(called)
    return list(found)


def _take_in(library: Any) -> None:
    """Put all that a library calls into it."""
    for called in _below(library):
        if hasattr(library, "_reload_init"):  # not before Numba 0.62
            library._reload_init.update(called._reload_init)
        module = called._final_module if isinstance(called, _Part) else called._get_module_for_linking()
        library._final_module.link_in(module, preserve=True)
    library._linking_libraries.clear()


@contextlib.contextmanager
def whole() -> Iterator[None]:
    """Compile what is compiled meanwhile, in this thread, as a whole."""
    usual = _Context.get_executable, _Context.create_cfunc_wrapper

    def get_executable(context: Any, library: Any, function: Any, environment: Any) -> Any:
        names = {each.name for each in library._final_module.functions}
        if library._finalized:
            return usual[0](context, library, function, environment)
        if function.llvm_cpython_wrapper_name in names:
            if library._linking_libraries:
                _take_in(library)
                # Once more than usual: as fast then as if the functions had been optimised before.
                library._optimize_final_module()
            return usual[0](context, library, function, environment)
        _become_part(library)
        # A name for callers to find it by; Python does not call it.
        return _dynfunc.make_function(
            function.lookup_module(), function.qualname, "", 0, environment, (library,)
        )

    # No other thread compiles before the lock is free again.
    with _lock:
        _Context.get_executable = get_executable
        _Context.create_cfunc_wrapper = lambda *_: None  # the entry for C, which nobody uses
        try:
            yield
        finally:
            _Context.get_executable, _Context.create_cfunc_wrapper = usual
