# SPDX-License-Identifier: Apache-2.0
"""Rows of runs for other tools: HDF5, MCAP, the features and frames of a LeRobot dataset, and force feedback of a
device with the interface of Isaac Lab's HaplyDevice."""

from __future__ import annotations

import json
import os
from contextlib import contextmanager
from os import PathLike, fspath
from pathlib import Path
from typing import Any, Iterator, Mapping, Optional, Sequence, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .batch import Batch
from .library import version
from .mcap_file import McapFile

_LATEST_S = 9e9  # the year 2255; nanoseconds of it fit into 63 bits


# LeRobot fills these in by itself and refuses a frame that has them.
_FILLED_IN = ("timestamp", "frame_index", "episode_index", "index", "task_index")


def write_hdf5(file: Union[str, PathLike[str]], rows: Mapping[str, ArrayLike],
               about: Mapping[str, Union[str, float]] = {}) -> None:
    """One data set for each name, the rows first; `about` as attributes of the file. An existing file is replaced
    once the new one is complete.

    :param rows: numbers or truth values, the rows first; equally many for each name
    :raises ValueError: which name is wrong, and what to give
    :raises ImportError: there is no h5py
    """
    arrays = _arrays(rows)
    try:
        import h5py
    except ImportError:
        raise ImportError("no h5py; apt-get install python3-h5py") from None
    with _replaced(file) as part, h5py.File(part, "w") as out:
        for name, array in arrays.items():
            out.create_dataset(name, data=array, compression="gzip")
        out.attrs.update(about)


def write_mcap(file: Union[str, PathLike[str]], rows: Mapping[str, ArrayLike], times_s: ArrayLike,
               about: Mapping[str, Union[str, float]] = {}) -> None:
    """One channel for each name, for Foxglove and the `mcap` tools; `about` as the metadata "about".

    A row is a JSON message {"value": …}: a number, or the list of its numbers, the last index fastest, whose shape
    the channel's metadata "shape" tells. Numbers that are not finite become null. An existing file is replaced once
    the new one is complete.

    :param rows: numbers or truth values, the rows first
    :param times_s: (rows,), s, from 0 on; ascending
    :raises ValueError: which row, name or time is wrong, and what to give
    """
    times_ns = _times_ns(times_s)
    arrays = _arrays(rows, len(times_ns))
    with _replaced(file) as part, open(part, "wb") as out:
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


@contextmanager
def _replaced(file: Union[str, PathLike[str]]) -> Iterator[str]:
    """A file beside `file` to write, which then takes its place; after an error `file` is as it was."""
    path = Path(os.path.realpath(fspath(file)))
    part = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        yield str(part)
        os.replace(part, path)
    finally:
        part.unlink(missing_ok=True)


def _arrays(rows: Mapping[str, ArrayLike], times: Optional[int] = None) -> dict[str, NDArray[Any]]:
    """The rows as arrays; `times`: how many there must be of each name; None: as many as of the first.

    :raises ValueError: which name is wrong, and what to give
    """
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
        count = f"{len(array)}" if array.ndim else "no"
        if times is not None and count != f"{times}":
            raise ValueError(f"{name}: {count} rows for {times} times; give one row for each time")
        if array.ndim == 0:
            raise ValueError(f"{name}: no rows; give an array, the rows first")
        for first, other in list(arrays.items())[:1]:
            if len(array) != len(other):
                raise ValueError(f"{name}: {count} rows, and {len(other)} of {first}; give equally many")
        arrays[name] = array
    if not arrays:
        raise ValueError("rows: there are none; give at least one name with its rows")
    return arrays


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
    """`features` of LeRobotDataset.create() for the frames of lerobot_frames(): dtype (float32 for every
    floating-point number), shape of one row ((1,) for a single number), names of its numbers. Keys of a dataset
    are "observation.state", "action", "next.reward" and so on.

    :param rows: numbers or truth values, the rows first; equally many for each name
    :raises ValueError: which name is wrong, and what to give
    """
    features: dict[str, dict[str, Any]] = {}
    for key, array in _arrays(rows).items():
        if key in _FILLED_IN or "/" in key:
            raise ValueError(f"{key}: LeRobot fills in {', '.join(_FILLED_IN)} and refuses \"/\"; leave it out or "
                             "give it another name")
        shape = array.shape[1:] or (1,)
        dtype = "float32" if array.dtype.kind == "f" else array.dtype.name
        given = list(names.get(key, [f"{key}_{i}" for i in range(int(np.prod(shape)))]))
        if len(given) != np.prod(shape):
            raise ValueError(f"{key}: {len(given)} names for {np.prod(shape)} numbers; give one for each")
        features[key] = {"dtype": dtype, "shape": tuple(shape), "names": given}
    return features


def lerobot_frames(rows: Mapping[str, ArrayLike], task: str) -> list[dict[str, Any]]:
    """Frames for LeRobotDataset.add_frame(), one for each row: arrays of the dtype and shape that
    lerobot_features(rows) gives, and "task".

    :param rows: of one copy, numbers or truth values, the rows first; equally many for each name
    :param task: in words, as the dataset has it
    :raises ValueError: which name is wrong, and what to give
    """
    if not isinstance(task, str) or not task:
        raise ValueError(f"task: {task!r}; give it in words")
    features = lerobot_features(rows)
    arrays = {key: array.astype(features[key]["dtype"]).reshape((len(array), *features[key]["shape"]))
              for key, array in _arrays(rows).items()}
    count = len(next(iter(arrays.values())))
    return [{**{key: array[i] for key, array in arrays.items()}, "task": task} for i in range(count)]


def push_force(device: Any, batch: Batch, copy: int = 0, tools: Optional[Sequence[int]] = None,
               most: float = 2.0) -> None:
    """The forces on the tools of a copy to a device with the interface of Isaac Lab's HaplyDevice:
    device.push_force(forces, position). `forces` is (tools, 3), N, float32, in frame W; `position` the indices of
    those that the device adds up, int64. Both are tensors where torch can be imported, otherwise arrays.

    The sum is at most `most` N long: longer ones are shortened together, with their direction kept. This is no
    guarantee of passivity: that is what device_node and mofc_node are for.

    :param tools: whose forces count; None: all
    :raises ValueError: there is no such tool
    """
    forces: NDArray[np.float64] = batch.force[copy]
    position = np.arange(len(forces)) if tools is None else np.asarray(tools, dtype=np.int64)
    if position.ndim != 1 or len(position) == 0 or not (0 <= position.min() and position.max() < len(forces)):
        raise ValueError(f"tools: {position.tolist()}; give indices from 0 to {len(forces) - 1}")
    length = float(np.linalg.norm(forces[position].sum(axis=0)))
    pushed: tuple[Any, Any] = ((forces * min(1.0, most / max(length, 1e-12))).astype(np.float32),
                               position.astype(np.int64))
    try:
        import torch
    except ImportError:
        pass
    else:
        pushed = (torch.from_numpy(pushed[0]), torch.from_numpy(pushed[1]))
    device.push_force(*pushed)
