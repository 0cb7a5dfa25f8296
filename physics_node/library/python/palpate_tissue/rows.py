# SPDX-License-Identifier: Apache-2.0
"""Rows of runs for other tools: HDF5, the features of a LeRobot dataset, and force feedback of a device in the
shape of Isaac Lab's."""

from __future__ import annotations

from os import PathLike, fspath
from typing import Any, Mapping, Sequence, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .batch import Batch


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
