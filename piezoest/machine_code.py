"""Where the machine code of compiled functions is kept, and when it is made again.

Numba's own cache knows a function by the file that it stands in, its name, and a number that counts the
functions of a process. That is not enough here: an equation is inlined into loops of other files, which would
go on with the old one after an edit. So machine code is kept with a digest of all sources that compiled
functions are made of (`sources`), and is taken from the disk only if that, Numba, the processor and the
options are the same.
"""

import ast
import contextlib
import functools
import hashlib
import inspect
import pickle
import re
import sys
import sysconfig
import tempfile
import time
import warnings
from pathlib import Path
from typing import Any

import llvmlite
import numba
from numba.core import config
from numba.core.caching import CompileResultCacheImpl
from numba.core.serialize import dumps
from numba.misc.appdirs import user_cache_dir

from piezoest._files import replacing

# Untyped: its options are not shown to a type checker.
_config: Any = config

_PACKAGE = Path(__file__).resolve().parent
# A file with functions for compiled loops, and what a file imports from this package.
_COMPILES = re.compile(
    r"^@(?:register_jitable|inlined|compiled|in_the_caller|njit)\b|^def inlined"
    r"|^    return inlined\(",
    re.MULTILINE,
)
# Folders of Python's own library and of installed packages.
_INSTALLED = {Path(sysconfig.get_path(name)).resolve() for name in ("stdlib", "purelib", "platlib")}
_IMPORTS = re.compile(r"^from (piezoest[\w.]*) import (\([^)]*\)|[^\n]*)", re.MULTILINE)


def _file_of(module: str) -> Path | None:
    place = _PACKAGE.parent.joinpath(*module.split("."))
    for path in (place.with_suffix(".py"), place / "__init__.py"):
        if path.is_file():
            return path
    return None


def _constants_of(text: str) -> set[Path]:
    """Files that a source takes modules or constants from, by its imports at the left margin."""
    found = set()
    for module, names in _IMPORTS.findall(text):
        for name in re.findall(r"\w+(?: as \w+)?", names.strip("()")):
            first = name.split()[0]
            path = _file_of(f"{module}.{first}") or (_file_of(module) if first.isupper() else None)
            if path is not None:
                found.add(path)
    return found


@functools.cache
def sources() -> tuple[Path, ...]:
    """Files that compiled functions are made of: those with any, and those they take constants from."""
    texts = {path: path.read_text(encoding="utf-8") for path in _PACKAGE.rglob("*.py")}
    found = {path for path, text in texts.items() if _COMPILES.search(text)}
    new = found
    while new:
        new = set().union(*(_constants_of(texts[path]) for path in new)) - found
        found = found | new
    return tuple(sorted(found))


# Files outside the package with functions that its compiled ones call: policies and models of one's own.
_noted: set[Path] = set()


def note_source(source: Any) -> None:
    """Say that compiled functions are made of this function, or of a module's, too, wherever it stands.

    With it come the modules that its file imports, but for this package and what is installed.
    """
    path = Path(inspect.getfile(source)).resolve()
    if _PACKAGE in path.parents or path in _noted:
        return
    _noted.add(path)
    with contextlib.suppress(OSError):
        _own_source(str(path))  # as it is imported
    if path.suffix != ".py" or _is_installed(path):
        return
    module = sys.modules.get(getattr(source, "__module__", source.__name__))
    package = getattr(module, "__package__", None) or ""
    for name in _imported_by(path.read_text(encoding="utf-8"), package):
        place = getattr(sys.modules.get(name), "__file__", None)
        if place and not _is_installed(Path(place)):
            note_source(sys.modules[name])


def _is_installed(path: Path) -> bool:
    return not _INSTALLED.isdisjoint(path.resolve().parents)


def _imported_by(text: str, package: str) -> set[str]:
    """Names of modules that a source of a package imports, and of what could be one."""
    found = set()
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Import):
            found |= {each.name for each in node.names}
        elif isinstance(node, ast.ImportFrom):
            above = package.split(".")[: len(package.split(".")) + 1 - node.level] if node.level else []
            origin = ".".join([*above, *([node.module] if node.module else [])])
            found |= {origin, *(f"{origin}.{each.name}" for each in node.names)}
    return found


# Functions are those of their files at import: a file that is newer than this says nothing of them.
_IMPORTED = time.time()


@functools.cache
def digest() -> str:
    """Fingerprint of `sources`: machine code made of other ones is never run."""
    found = hashlib.sha256()
    for path in sources():
        found.update(path.relative_to(_PACKAGE).as_posix().encode() + b"\0" + path.read_bytes() + b"\0")
    return found.hexdigest()


@functools.cache
def folder() -> Path | None:
    """Folder of machine code: Numba's if one is named, the package's own, or the user's; None without any."""
    name = f"piezoest-{hashlib.sha256(str(_PACKAGE).encode()).hexdigest()[:12]}"
    users: Any = user_cache_dir
    places = [_PACKAGE / "__pycache__", Path(users("numba", appauthor=False)) / name]
    named: str = _config.CACHE_DIR
    if named:
        places.insert(0, Path(named) / name)
    for place in places:
        try:
            place.mkdir(parents=True, exist_ok=True)
            with tempfile.TemporaryFile(dir=place):
                return place
        except OSError:
            continue
    warnings.warn(
        "no folder for compiled code can be written, each start compiles anew: name one in NUMBA_CACHE_DIR",
        RuntimeWarning,
        stacklevel=2,
    )
    return None


@functools.cache
def _own_source(path: str) -> str:
    """Fingerprint of a file outside the package that has compiled functions of its own."""
    return "" if Path(path) in sources() else hashlib.sha256(Path(path).read_bytes()).hexdigest()


class MachineCode:
    """Machine code of one function in one file for each signature: what Numba asks of a cache.

    A file begins with the fingerprint of what it was made of and what it holds, so that one made of other
    sources, by another Numba or for another processor, and one that is damaged, are all compiled again.
    """

    def flush(self) -> None:
        """Do nothing: files that no longer fit are written over."""

    def __init__(self, function: Any, options: dict[str, Any]) -> None:
        self._name = f"{function.__module__}.{function.__qualname__}"
        self._function = function
        with contextlib.suppress(OSError):
            _own_source(inspect.getfile(function))  # as it is imported; what is edited later is another
        self._made_with = (numba.__version__, llvmlite.__version__, sys.version, sorted(options.items()))

    @property
    def _outside(self) -> list[str]:
        """Files outside the package that the function may be made of, its own first."""
        return [inspect.getfile(self._function), *map(str, sorted(_noted))]

    def _place(self, signature: Any) -> Path | None:
        place = folder()
        # By what stands outside, too: programs with models of their own leave each other's files alone.
        made_of = (str(signature), [_own_source(path) for path in self._outside])
        code = hashlib.sha256(repr(made_of).encode()).hexdigest()[:16]
        return None if place is None else place / f"{self._name}-{code}.nbc"

    def _fingerprint(self, signature: Any, codegen: Any, code: bytes) -> bytes:
        own = [_own_source(path) for path in self._outside]
        made_of = (digest(), own, self._made_with, codegen.magic_tuple(), str(signature))
        return hashlib.sha256(repr(made_of).encode() + code).digest()

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Function for a signature from the disk; None if it is not there, or not of these sources."""
        target_context.refresh()
        place = self._place(sig)
        try:
            kept = b"" if place is None else place.read_bytes()
        except OSError:
            return None
        size = hashlib.sha256().digest_size
        if kept[:size] != self._fingerprint(sig, target_context.codegen(), kept[size:]):
            return None
        rebuild: Any = CompileResultCacheImpl.rebuild
        return rebuild(self, target_context, pickle.loads(kept[size:]))

    def save_overload(self, sig: Any, data: Any) -> None:
        """Keep a function; where the disk is full, the next start compiles again."""
        place = self._place(sig)
        if place is None or data.library.has_dynamic_globals:
            return
        if any(path.stat().st_mtime > _IMPORTED for path in sources()):
            return
        serialise: Any = dumps
        reduce: Any = CompileResultCacheImpl.reduce
        code: bytes = serialise(reduce(self, data))
        with contextlib.suppress(OSError), replacing(place) as beside:
            beside.write_bytes(self._fingerprint(sig, data.codegen, code) + code)

    @property
    def cache_path(self) -> str:
        """Folder of the files."""
        return str(folder())
