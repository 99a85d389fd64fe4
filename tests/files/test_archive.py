"""Archives that are read array by array: no more than what is asked for, and nothing that is none."""

from __future__ import annotations

import io
import zipfile
from pathlib import Path

import numpy as np
import pytest

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.files.archive import Archive, write_archive

ARRAYS = {
    "a": np.arange(6.0).reshape(2, 3),
    "text": np.array("one line"),
    "flags": np.ones(3, np.uint8),
}


@pytest.fixture
def path(tmp_path: Path) -> Path:
    write_archive(tmp_path / "x.npz", iter(ARRAYS.items()))
    return tmp_path / "x.npz"


def archive(path: Path, most: int = 10_000, members: int = 5) -> Archive:
    return Archive(path, "an archive", most, members)


def test_arrays_come_back_one_by_one(path: Path) -> None:
    """As numpy reads them, too."""
    assert archive(path).names() == list(ARRAYS)
    for name, array in ARRAYS.items():
        (found,) = archive(path).read([name], 1000).values()
        assert found.dtype == array.dtype
        assert np.array_equal(found, array)
        assert np.array_equal(np.load(path)[name], array)


def test_equal_arrays_make_equal_files(path: Path, tmp_path: Path) -> None:
    write_archive(tmp_path / "y.npz", ARRAYS.items())
    assert (tmp_path / "y.npz").read_bytes() == path.read_bytes()


def test_a_writer_that_fails_leaves_nothing(tmp_path: Path) -> None:
    def arrays() -> object:
        yield "a", ARRAYS["a"]
        raise InputError("x", "y", "z", "w")

    with pytest.raises(InputError):
        write_archive(tmp_path / "x.npz", arrays())  # type: ignore[arg-type]
    assert not list(tmp_path.iterdir())


def test_limits_hold_before_anything_is_unpacked(path: Path) -> None:
    for small, message in (
        (archive(path, members=2), "more than 2 arrays"),
        (archive(path, most=100), "at most 100 bytes"),
    ):
        with pytest.raises(InputError, match=message):
            small.names()
    with pytest.raises(InputError, match="arrays of at most 100 bytes"):
        archive(path).read(["a"], 100)
    with pytest.raises(InputError, match="KeyError"):
        archive(path).read(["b"], 100)


def zipped(**members: bytes) -> bytes:
    data = io.BytesIO()
    with zipfile.ZipFile(data, "w") as file:
        for name, content in members.items():
            file.writestr(f"{name}.npy", content)
    return data.getvalue()


def end_changed(at: int, value: bytes) -> bytes:
    """An archive of one array, with other bytes in the record at its end."""
    data = bytearray(zipped(a=b"x"))
    start = len(data) - 22 + at
    data[start : start + len(value)] = value
    return bytes(data)


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"", "no archive"),
        (b"PK" * 200, "no plain archive"),
        (zipped(a=b"x")[:-1], "archive"),
        (zipped(a=b"x") + b"more", "no plain archive"),
        (end_changed(12, b"\xff\xff\xff\x7f"), "more than 5 arrays"),
        (
            zipped(a=b"x")[:-22] + b"PK\x06\x07" + bytes(16) + zipped(a=b"x")[-22:],
            "no plain archive",
        ),
        (zipped(a=b"x"), "another header"),
    ],
)
def test_what_is_no_archive_is_refused(data: bytes, message: str, tmp_path: Path) -> None:
    (tmp_path / "x.npz").write_bytes(data)
    with pytest.raises(InputError, match=message):
        archive(tmp_path / "x.npz").read(["a"], 1000)


def test_objects_are_refused(tmp_path: Path) -> None:
    np.savez(tmp_path / "x.npz", a=np.array([{}], dtype=object))
    with pytest.raises(
        InputError, match=r"array a: expected an array of numbers, found Python objects"
    ):
        archive(tmp_path / "x.npz").read(["a"], 1000)


@pytest.mark.parametrize("order", ["<", ">"])
def test_text_of_characters_that_do_not_exist_is_refused(tmp_path: Path, order: str) -> None:
    """Of either order of bytes; the last character that exists is read."""
    codes = np.array([65, 0x10FFFF], f"{order}u4")
    for last, exists in ((0x10FFFF, True), (0x110000, False), (2**32 - 1, False)):
        codes[1] = last
        np.savez(tmp_path / "x.npz", a=codes.view(f"{order}U1"))
        if exists:
            (found,) = archive(tmp_path / "x.npz").read(["a"], 1000).values()
            assert found.tolist() == ["A", "\U0010ffff"]
            continue
        with pytest.raises(InputError, match=r"array a: expected text, found characters that do"):
            archive(tmp_path / "x.npz").read(["a"], 1000)
