# SPDX-License-Identifier: Apache-2.0
"""Rows of runs for other tools: HDF5, MCAP, the features of a LeRobot dataset, and force feedback of a device in
the shape of Isaac Lab's."""

from __future__ import annotations

import json
from os import PathLike, fspath
from typing import Any, Iterator, Mapping, Sequence, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .batch import Batch
from .library import version
from .mcap_file import McapFile

_LATEST_S = 9e9  # the year 2255; nanoseconds of it fit into 63 bits


def write_hdf5(file: Union[str, PathLike[str]], rows: Mapping[str, ArrayLike],
               about: Mapping[str, Union[str, float]] = {}) -> None:
    """One data set for each name, the rows first; `about` as attributes of the file.

    :raises ImportError: there is no h5py
    """
    try:
        import h5py
    except ImportError:
        raise ImportError("no h5py; apt-get install python3-h5py") from None
    with h5py.File(fspath(file), "w") as out:
        for name, value in rows.items():
            out.create_dataset(name, data=np.asarray(value), compression="gzip")
        out.attrs.update(about)


def write_mcap(file: Union[str, PathLike[str]], rows: Mapping[str, ArrayLike], times_s: ArrayLike,
               about: Mapping[str, Union[str, float]] = {}) -> None:
    """One channel for each name, for Foxglove and the `mcap` tools; `about` as the metadata "about".

    A row is a JSON message {"value": …}: a number, or the list of its numbers, the last index fastest, whose shape
    the channel's metadata "shape" tells. Numbers that are not finite become null.

    :param rows: numbers or truth values, the rows first
    :param times_s: (rows,), s, from 0 on; ascending
    :raises ValueError: which row, name or time is wrong, and what to give
    """
    times_ns = _times_ns(times_s)
    arrays: dict[str, NDArray[Any]] = {}
    for name, value in rows.items():
        try:
            array: NDArray[Any] = np.asarray(value)
        except ValueError:  # rows of different shapes
            array = np.asarray(None)
        if not name:
            raise ValueError('rows: a name is ""; give each one a name')
        if array.dtype.kind not in "biuf":
            raise ValueError(f"{name}: {array.dtype}; give numbers or truth values, each row of the same shape")
        if array.ndim == 0 or len(array) != len(times_ns):
            raise ValueError(f"{name}: {len(array) if array.ndim else 'no'} rows for {len(times_ns)} times; "
                             "give one row for each time")
        arrays[name] = array
    if not arrays:
        raise ValueError("rows: there are none; give at least one name with its rows")
    with open(fspath(file), "wb") as out:
        mcap = McapFile(out, f"palpate_tissue {version()}")
        channels = {name: mcap.add_channel(name, f"palpate_tissue.{name}", _schema(array),
                                           {"shape": json.dumps(array.shape[1:])})
                    for name, array in arrays.items()}
        mcap.add_metadata("about", {key: str(value) for key, value in about.items()})
        messages = {name: _messages(array) for name, array in arrays.items()}
        for time_ns in times_ns:
            for name, channel in channels.items():
                mcap.write(channel, time_ns, next(messages[name]))
        mcap.finish()


def _times_ns(times_s: ArrayLike) -> list[int]:
    times: NDArray[Any] = np.asarray(times_s)
    if times.dtype.kind not in "iuf" or times.ndim != 1 or len(times) == 0:
        raise ValueError(f"times_s: {times.dtype} {times.shape}; give the time of each row in s, (rows,)")
    for i, time in enumerate(times):
        if not 0.0 <= time <= _LATEST_S:
            raise ValueError(f"times_s[{i}] = {time}: must be finite, 0 to {_LATEST_S:g} s; subtract the first time")
    times_ns = [int(round(float(time) * 1e9)) for time in times]
    for i, (before, after) in enumerate(zip(times_ns, times_ns[1:]), 1):
        if after <= before:
            raise ValueError(f"times_s[{i}] = {times[i]} after {times[i - 1]}: must ascend, by at least 1 ns; sort the "
                             "rows, or write one file for each run")
    return times_ns


def _schema(array: NDArray[Any]) -> dict[str, Any]:
    number = {"type": {"b": "boolean", "f": "number"}.get(array.dtype.kind, "integer")}
    value = number if array.ndim == 1 else {"type": "array", "items": number}
    return {"type": "object", "properties": {"value": value}}


def _messages(array: NDArray[Any]) -> Iterator[bytes]:
    flat = array if array.ndim == 1 else array.reshape(len(array), -1)
    is_finite = array.dtype.kind != "f" or bool(np.isfinite(array).all())
    for row in flat:
        value = row.tolist()
        if not is_finite:
            value = _with_nulls(value)
        yield json.dumps({"value": value}, allow_nan=False).encode()


def _with_nulls(value: Any) -> Any:
    if isinstance(value, list):
        return [_with_nulls(one) for one in value]
    return value if np.isfinite(value) else None


def lerobot_features(rows: Mapping[str, ArrayLike],
                     names: Mapping[str, Sequence[str]] = {}) -> dict[str, dict[str, Any]]:
    """`features` of LeRobotDataset.create() for rows of this shape: dtype, shape of one row, names of its
    numbers. Keys of a dataset are "observation.state", "action", "next.reward" and so on.

    :raises ValueError: a name is missing or too many
    """
    features: dict[str, dict[str, Any]] = {}
    for key, value in rows.items():
        array: NDArray[Any] = np.asarray(value)
        shape = array.shape[1:] or (1,)
        dtype = "float32" if array.dtype.kind == "f" else array.dtype.name
        given = list(names.get(key, [f"{key}_{i}" for i in range(int(np.prod(shape)))]))
        if len(given) != np.prod(shape):
            raise ValueError(f"{key}: {len(given)} names for {np.prod(shape)} numbers; give one for each")
        features[key] = {"dtype": dtype, "shape": tuple(shape), "names": given}
    return features


def push_force(device: Any, batch: Batch, copy: int = 0, names: Sequence[str] = ("tool",), frame: str = "world",
               most: float = 2.0) -> None:
    """The forces on the tools of a copy to a device: device.push_force(forces (tools, 3), names, frame). A longer
    force is shortened to `most` N. This is no guarantee of passivity: that is what device_node and mofc_node are
    for."""
    forces: NDArray[np.float64] = batch.force[copy].copy()
    if len(names) != len(forces):
        raise ValueError(f"{len(names)} names for {len(forces)} tools; give one for each")
    length = np.linalg.norm(forces, axis=1, keepdims=True)
    forces *= np.minimum(1.0, most / np.maximum(length, 1e-12))
    device.push_force(forces, list(names), frame)
