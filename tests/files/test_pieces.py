"""Packed arrays: which ones, read back to the bit, and what is refused."""

from __future__ import annotations

import io
from pathlib import Path

import h5py
import numpy as np
import pytest
import xarray as xr

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.files import pieces
from ellipsoid_coupling.files.checksum import sealed
from ellipsoid_coupling.files.netcdf import read_netcdf, write_netcdf

MARK = b"\nellipsoid_coupling sha256"


def field(times: int, side: int = 200) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    """(times, side, side): random numbers in a quarter, else 0."""
    values = np.zeros((times, side, side))
    values[:, : side // 2, : side // 2] = np.random.default_rng(0).random(
        (times, side // 2, side // 2)
    )
    return values


def dataset(values: np.ndarray[tuple[int, ...], np.dtype[np.float64]]) -> xr.Dataset:
    times, ny, nx = values.shape
    return xr.Dataset(
        {"density": (("time", "y", "x"), values)},
        coords={
            "time": np.arange(float(times)),
            "y": np.arange(float(ny)),
            "x": np.arange(float(nx)),
        },
    )


@pytest.mark.parametrize("times", [1, 3, 70, 5000])
def test_packed_arrays_come_back_to_the_bit(times: int, tmp_path: Path) -> None:
    """1 and 3 save times are one node of HDF5's tree, 70 two levels, 5000 three; -0.0 and NaN too."""
    side = 200 if times < 100 else 8
    values = field(times, side)
    values[0, -1, :2] = -0.0, np.nan
    write_netcdf(dataset(values), tmp_path / "a.nc")
    assert (tmp_path / "a.nc").stat().st_size < 0.5 * values.nbytes + 100 * times
    assert read_netcdf(tmp_path / "a.nc").arrays["density"].tobytes() == values.tobytes()
    with xr.open_dataset(tmp_path / "a.nc", engine="h5netcdf") as data:
        assert data["density"].to_numpy().tobytes() == values.tobytes()


def test_only_what_gets_smaller_is_packed() -> None:
    """Neither what is small, nor noise, nor what has no time in front."""
    noise = np.random.default_rng(0).random((2, 300, 300))
    assert pieces.packing(field(2))
    assert not pieces.packing(noise)
    assert not pieces.packing(field(2, 20))
    assert not pieces.packing(np.zeros(10**6))


def test_empty_cells_are_nan_in_packed_and_plain_arrays(tmp_path: Path) -> None:
    for values in (field(2), np.random.default_rng(0).random((2, 300, 300))):
        data = dataset(values)
        data["density"].attrs["_FillValue"] = np.nan
        empty = values < 0.25
        write_netcdf(data, tmp_path / "a.nc", empty)
        read = read_netcdf(tmp_path / "a.nc").arrays["density"]
        assert np.array_equal(np.isnan(read), empty)
        assert np.array_equal(read[~empty], values[~empty])


@pytest.mark.parametrize("place", range(12))
def test_a_damaged_piece_is_refused(place: int, tmp_path: Path) -> None:
    """Bytes of the tree and of the packed numbers changed, with a right checksum."""
    write_netcdf(dataset(field(3)), tmp_path / "a.nc")
    data = (tmp_path / "a.nc").read_bytes()
    data = data[: data.rindex(MARK)]
    tree = data.index(b"TREE\x01")
    with h5py.File(io.BytesIO(data)) as file:
        chunk = file["density"].id.get_chunk_info(1)
    # The kind of node, its level, the number of entries, of the first entry its size, filters that it
    # leaves out, its place in the array and in the file; then packed numbers, from head to checksum.
    at = [tree + k for k in (4, 5, 6, 24, 28, 32, 40, 64)]
    at += [chunk.byte_offset + k for k in (0, 1, chunk.size // 2, chunk.size - 1)]
    changed = bytearray(data)
    changed[at[place]] ^= 255
    (tmp_path / "b.nc").write_bytes(sealed(bytes(changed)))
    with pytest.raises(InputError, match=r"b\.nc: expected a result file"):
        read_netcdf(tmp_path / "b.nc")


def test_a_bomb_is_refused_before_it_goes_off(tmp_path: Path) -> None:
    """8 TB of zeros in a small file: more than packing can hold."""
    memory = io.BytesIO()
    with h5py.File(memory, "w", libver="earliest", track_order=True) as file:
        shape = (10_000, 10_000, 10_000)
        file.create_dataset(
            "density", shape, "f8", chunks=(1, *shape[1:]), shuffle=True, compression="gzip",
            compression_opts=1, track_order=True,
        )  # fmt: skip
    (tmp_path / "a.nc").write_bytes(sealed(memory.getvalue()))
    with pytest.raises(InputError, match="bytes of packed numbers in a file of"):
        read_netcdf(tmp_path / "a.nc")


@pytest.mark.parametrize(
    "packing",
    [
        {"chunks": (1, 10, 10), "compression": "gzip"},
        {"chunks": (1, 10, 10), "shuffle": True},
        {"chunks": (1, 5, 10), "shuffle": True, "compression": "gzip"},
        {"chunks": (1, 10, 10), "shuffle": True, "compression": "gzip", "fletcher32": True},
        {"chunks": (1, 10, 10), "shuffle": True, "compression": "lzf"},
        {"chunks": (2, 10, 10), "shuffle": True, "compression": "gzip"},
    ],
)
def test_other_ways_to_pack_are_refused(packing: dict[str, object], tmp_path: Path) -> None:
    memory = io.BytesIO()
    with h5py.File(memory, "w", libver="earliest", track_order=True) as file:
        file.create_dataset("density", data=np.ones((2, 10, 10)), track_order=True, **packing)
    (tmp_path / "a.nc").write_bytes(sealed(memory.getvalue()))
    with pytest.raises(InputError, match="in pieces, packed, or in another file"):
        read_netcdf(tmp_path / "a.nc")
