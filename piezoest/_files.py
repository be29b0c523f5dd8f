"""Files that come out whole or not at all, and JSON that comes in."""

import contextlib
import errno
import json
import os
import shutil
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

FIGURES, REPORTS = (".png", ".pdf", ".svg", ".jpg", ".jpeg"), (".html", ".htm")  # endings


def check_targets(
    keep: Iterable[Path] = (),
    *,
    figure: Path | None = None,
    output: Path | None = None,
    report: Path | None = None,
) -> None:
    """Refuse what cannot be written before the work is done; files to keep are not written over."""
    kept = {path.resolve() for path in keep}
    for path, endings in ((figure, FIGURES), (output, ()), (report, REPORTS)):
        if path is None:
            continue
        if endings and path.suffix.lower() not in endings:
            raise ValueError(f"{path}: its name must end in one of {' '.join(endings)}")
        if path.resolve() in kept:
            raise ValueError(f"{path} is named twice: give what is written a file of its own")
        if path.name == "-":
            raise ValueError("- is no file: name one, or /dev/stdout")
        if path.is_dir():
            raise ValueError(f"{path} is a folder: name a file in it")
        if not path.resolve().parent.is_dir():
            raise ValueError(f"{path}: there is no folder {path.resolve().parent}")
        kept.add(path.resolve())


@contextlib.contextmanager
def replacing(path: str | Path) -> Iterator[Path]:
    """Name of an empty file beside `path`, which takes its place when the ``with`` block is done.

    Whatever happens before, even a kill or a full disk, leaves the file that was there as it was. Devices,
    pipes and what the process has open (``/dev/stdout``) have no place to take: their own name comes back.
    """
    target = _regular(Path(path))
    # The ending says the format to those who write; glob passes over the point.
    temporary = target.with_name(f".{os.urandom(6).hex()}{target.suffix}") if target else Path(path)
    try:
        if target is not None:
            _make(temporary, target)
        yield temporary
        if target is not None:
            with temporary.open("rb+") as file:
                os.fsync(file.fileno())
            temporary.replace(target)
    except OSError as error:
        if error.errno is None:  # NumPy counts what it wrote
            raise OSError(f"{path} cannot be written whole: {error}") from error
        if error.filename in (None, str(temporary)):
            raise OSError(error.errno, os.strerror(error.errno), str(path)) from error
        raise
    finally:
        if target is not None:
            with contextlib.suppress(OSError):
                temporary.unlink()


def write_text(path: str | Path, text: str) -> None:
    """Write a text as UTF-8, by `replacing`."""
    with replacing(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def save_figure(figure: Any, path: str | Path, **options: Any) -> None:
    """Write a figure of Matplotlib by `replacing`, with options of its ``savefig``; makes its folder."""
    Path(path).parent.mkdir(parents=True, exist_ok=True)
    with replacing(path) as temporary:
        figure.savefig(temporary, **options)


def read_json(path: str | Path) -> Any:
    """What a JSON file holds. OSError if it cannot be read."""
    try:
        return json.loads(Path(path).read_text(encoding="utf-8-sig"))  # editors of Windows add a mark
    except ValueError as error:
        raise ValueError(f"{path} is not JSON: {error}") from None
    except RecursionError:
        raise ValueError(f"{path} is not JSON of ours: it is nested too deeply") from None


def read_object(path: str | Path, what: str) -> dict[str, Any]:
    """The dictionary that a JSON file holds. OSError if it cannot be read."""
    data = read_json(path)
    if not isinstance(data, dict):
        raise ValueError(f"{path} holds no {what}")
    return data


def _regular(path: Path) -> Path | None:
    """Regular file, there or to be, at the end of all links; None if it is something else."""
    for _ in range(40):
        folder = os.path.realpath(path.parent)
        if folder.startswith(("/proc/", "/dev/fd")):  # of the open files of a process
            return None
        path = Path(folder, path.name)
        if not path.is_symlink():
            break
        path = Path(folder, path.readlink())
    return path if path.is_file() or not path.exists() else None


def _make(temporary: Path, target: Path) -> None:
    """Make an empty file with the owner and the rights of the one that it will replace, if any."""
    if target.exists() and not os.access(target, os.W_OK):
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(temporary))
    os.close(os.open(temporary, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666))
    if target.exists():
        with contextlib.suppress(OSError):  # others than root may give nothing away
            known = target.stat()
            os.chown(temporary, known.st_uid, known.st_gid)
        shutil.copymode(target, temporary)
