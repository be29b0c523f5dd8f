"""Logs that are damaged, or not what they say: one sentence that names the file, and no memory taken."""

import gzip
import random
import struct
import zipfile
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from piezoest.records import read_record, write_columns
from tests.logs import LOG, N, write_hdf5, write_lvm, write_sheets, write_tdms


def hdf5_that_declares_much(path: Path) -> None:
    with pytest.importorskip("h5py").File(path, "w") as file:
        for name in LOG:
            file.create_dataset(name, shape=(2**36,), dtype="f8", chunks=(1024,))


def declare(file: Any, *shape: int) -> None:
    np.lib.format.write_array_header_1_0(file, {"descr": "<f8", "fortran_order": False, "shape": shape})


def npz(path: Path, numbers: int, megabytes: int = 0) -> None:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive, archive.open("x.npy", "w") as inside:
        declare(inside, numbers)
        for _ in range(megabytes):
            inside.write(bytes(1 << 20))


def npy_that_declares_much(path: Path) -> None:
    with path.open("wb") as file:
        declare(file, 3, 2**40)


def mat_that_declares_much(path: Path) -> None:
    # An array of doubles of shape (1, 2**29), as its flags, shape and name say.
    array = struct.pack("<8I", 6, 8, 6, 0, 5, 8, 1, 2**29) + b"\1\0\1\0u\0\0\0"
    packed = zlib.compress(struct.pack("<2I", 14, 0xF0000000) + array + bytes(1000))
    head = b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM"
    path.write_bytes(head + struct.pack("<2I", 15, len(packed)) + packed)


def parquet_of_nothing_but_zeros(path: Path) -> None:
    pa, pq = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    zeros = pa.array(np.zeros(2**22))
    pq.write_table(pa.table(dict.fromkeys(LOG, zeros)), path, compression="zstd")


def spreadsheet_without_sheets(path: Path) -> None:
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("[Content_Types].xml", "<Types/>")
        archive.writestr("xl/workbook.xml", "<workbook/>")


@pytest.mark.parametrize(
    ("name", "make", "words"),
    [
        ("log.h5", hdf5_that_declares_much, "declares 5.5e[+]05 MB of numbers"),
        ("log.npz", lambda path: npz(path, 2**22, 32), "declares 33.6 MB of numbers"),
        ("log.npz", lambda path: npz(path, 2**50), "cannot be read as NumPy"),
        ("log.npy", npy_that_declares_much, "cannot be read as NumPy"),
        ("log.mat", mat_that_declares_much, "declares 4.29e[+]03 MB of numbers"),
        ("log.parquet", parquet_of_nothing_but_zeros, "declares 33.6 MB of numbers"),
        ("log.xlsx", spreadsheet_without_sheets, "cannot be read as a spreadsheet"),
    ],
)
def test_what_a_file_declares_is_checked(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, make: Any, words: str
) -> None:
    monkeypatch.setattr("piezoest.records.source.PLENTY", 1 << 24)
    make(tmp_path / name)
    with pytest.raises(ValueError, match=rf"log\.\w+: .*{words}"):
        read_record(tmp_path / name)


def storage(file: Any, source: str) -> None:
    raw = Path(file.filename).with_name("raw")
    raw.write_bytes(LOG["displacement_um"].tobytes())
    file.create_dataset("position_um", shape=(N,), dtype="f8", external=[(raw, 0, 8 * N)])


def link(file: Any, source: str) -> None:
    file["position_um"] = pytest.importorskip("h5py").ExternalLink(source, "/displacement_um")


def virtual(file: Any, source: str) -> None:
    h5py = pytest.importorskip("h5py")
    layout = h5py.VirtualLayout((N,), "f8")
    layout[:] = h5py.VirtualSource(source, "displacement_um", shape=(N,))
    file.create_virtual_dataset("position_um", layout)


@pytest.mark.parametrize("elsewhere", [storage, link, virtual])
def test_other_files_are_not_opened(tmp_path: Path, elsewhere: Callable[[Any, str], None]) -> None:
    h5py = pytest.importorskip("h5py")
    for name in ("other.h5", "log.h5"):
        write_hdf5(tmp_path / name)
    with h5py.File(tmp_path / "log.h5", "r+") as file:
        del file["displacement_um"]
        elsewhere(file, "other.h5")
    with pytest.raises(ValueError, match=r"log\.h5: \w+ lies in another file"):
        read_record(tmp_path / "log.h5")
    # What lies in the file is read.
    write_hdf5(tmp_path / "log.h5")
    with h5py.File(tmp_path / "log.h5", "r+") as file:
        file["above"], file["nowhere"], file["none"] = file["/"], h5py.SoftLink("/nothing"), h5py.Empty("f8")
        virtual(file, ".")
    assert len(read_record(tmp_path / "log.h5", columns={"displacement": "position_um"})) == N


TEXT = "time_s,voltage_V,displacement_um\n" + "".join(f"{k},{k},{k}\n" for k in range(N))


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("log.csv", TEXT + '1,2,"' + "a" * 20_000_000 + '"\n', "line 62: more than 1048576 characters"),
        ("log.csv", TEXT + '1,2,"' + "a" * 200_000 + '"\n', "field larger than"),
        ("log.csv", "a" * 20_000_000, "line 1: more than"),
        ("log.csv", TEXT.replace("time_s", "q" * 1000), "are the columns q{60}…, voltage_V, displ"),
        ("log.dat", "\x02\x05" * 200, "not a text file"),
        ("log.csv", TEXT + "60,2," + "a" * 500 + "\n", "column 'displacement_um': 'a{59}.*' is not a number"),
    ],
)
def test_text_that_is_no_log(tmp_path: Path, name: str, content: str, words: str) -> None:
    path = tmp_path / name
    path.write_text(content, encoding="utf-8")
    with pytest.raises(ValueError, match=words) as refusal:
        read_record(path)
    assert str(path) in str(refusal.value)
    assert len(str(refusal.value)) < 400 + len(str(path))


@pytest.mark.parametrize("rate", [[1e3, 1e3], "fast", np.nan, -5.0])
def test_a_sample_rate_that_is_none_is_not_taken(tmp_path: Path, rate: Any) -> None:
    path, columns = tmp_path / "log.h5", {name: values for name, values in LOG.items() if name != "time_s"}
    write_hdf5(path, columns, sample_rate=rate)
    with pytest.raises(ValueError, match=r"log\.h5: no column for time found"):
        read_record(path)
    assert read_record(path, sample_rate=50.0).sample_rate == 50.0
    write_hdf5(path, columns, sample_rate=[100.0])
    assert read_record(path).sample_rate == 100.0


def packed(path: Path) -> None:
    plain = path.with_name("plain.csv")
    write_columns(plain, LOG)
    path.write_bytes(gzip.compress(plain.read_bytes()))


MAKERS: dict[str, Callable[[Path], Any]] = {
    **dict.fromkeys(("csv", "npy", "h5", "parquet"), lambda path: write_columns(path, LOG)),
    "csv.gz": packed,
    "lvm": lambda path: write_lvm(path, ((slice(0, 30), 0.0, 0.0), (slice(30, N), 0.3, 0.0))),
    "tdms": write_tdms,
    "xlsx": lambda path: write_sheets(path, log=[list(LOG), *np.column_stack(list(LOG.values())).tolist()]),
    "npz": lambda path: np.savez_compressed(path, **LOG),
}


@pytest.mark.parametrize("ending", MAKERS)
def test_any_damage_ends_in_one_sentence(tmp_path: Path, ending: str) -> None:
    if ending in ("h5", "parquet"):
        pytest.importorskip("h5py" if ending == "h5" else "pyarrow")
    path = tmp_path / f"log.{ending}"
    MAKERS[ending](path)
    assert len(read_record(path)) == N
    good, chance = path.read_bytes(), random.Random(0)
    said: list[str] = []
    for _ in range(150):
        damaged = bytearray(good)
        for _ in range(chance.choice([1, 1, 2, 5])):
            at = chance.randrange(min(len(damaged), chance.choice([500, len(damaged)])))
            if chance.random() < 0.3:
                damaged[at : at + 4] = chance.choice([b"\xff\xff\xff\x7f", b"\xff\xff\xff\xff", b"\0\0\0\0"])
            elif chance.random() < 0.3:
                del damaged[at : at + chance.randrange(1, 50)]
            else:
                damaged[at] = chance.randrange(256)
        path.write_bytes(damaged)
        try:
            read_record(path)
        except ValueError as error:
            said.append(str(error))
    assert len(said) > 50
    assert all(str(path) in each and "\n" not in each for each in said)
    assert max(map(len, said)) < 500 + len(str(path))
