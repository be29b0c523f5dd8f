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


class _Whole(_Library):  # type: ignore[misc]
    """The code of a function with all that it calls, optimised as one."""

    def is_part(self, function: Any) -> bool:
        """Whether it is new, and Python cannot call its function."""
        if self._finalized:
            return False
        return function.llvm_cpython_wrapper_name not in {each.name for each in self._final_module.functions}

    def below(self, known: dict[Any, None]) -> dict[Any, None]:
        """Return what this function calls, and what that calls, each before those that call it."""
        for called in self._linking_libraries:
            if called not in known:
                if isinstance(called, _Part):
                    called.below(known)
                known[called] = None
        return known

    def take_in(self) -> None:
        """Take in what is below: callers first, for LLVM drops what nobody has called yet."""
        for called in reversed(self.below({})):
            if hasattr(self, "_reload_init"):  # not before Numba 0.62
                self._reload_init.update(called._reload_init)
            part = isinstance(called, _Part)
            module = called._final_module if part else called._get_module_for_linking()
            self._final_module.link_in(module, preserve=True)
        self._linking_libraries.clear()

    def optimise(self) -> None:
        """Optimise once more than Numba does: as fast then as if the parts had been optimised before."""
        if self._linking_libraries:
            self.take_in()
            self._optimize_final_module()


class _Part(_Whole):
    """The code of a function that only other compiled ones call: neither optimised nor machine code."""

    def leave(self) -> None:
        """Leave it as it is. Several callers may take it in: one copy is kept."""
        self._finalized = True
        for function in self._final_module.functions:
            if not function.is_declaration and function.linkage == Linkage.external:
                function.linkage = "linkonce_odr"

    def _get_module_for_linking(self) -> Any:
        """Return the code with all that it calls, for a caller that is compiled elsewhere."""
        if self._linking_libraries:
            self.take_in()
        return self._final_module


@contextlib.contextmanager
def whole() -> Iterator[None]:
    """Compile what is compiled meanwhile, in this thread, as a whole."""
    usual = _Context.get_executable, _Context.create_cfunc_wrapper

    def get_executable(context: Any, library: Any, function: Any, environment: Any) -> Any:
        library.__class__ = _Whole
        if library.is_part(function):
            library.__class__ = _Part
            library.leave()
            # A name for callers to find it by; Python does not call it.
            name = function.qualname
            return _dynfunc.make_function(function.lookup_module(), name, "", 0, environment, (library,))
        library.optimise()
        return usual[0](context, library, function, environment)

    # No other thread compiles before the lock is free again.
    with _lock:
        _Context.get_executable = get_executable
        _Context.create_cfunc_wrapper = lambda *_: None  # the entry for C, which nobody uses
        try:
            yield
        finally:
            _Context.get_executable, _Context.create_cfunc_wrapper = usual
