# SPDX-License-Identifier: Apache-2.0
"""A stub of what sofa_physics.py uses of SofaPython3: a node, data as arrays, and the animation of one
tool above a stiff floor, coupled to its goal."""

from contextlib import contextmanager
from typing import Any, Iterator

import numpy as np
from numpy.typing import NDArray


class Data:
    def __init__(self, value: Any) -> None:
        self._value = np.array(value)

    def array(self) -> NDArray[Any]:
        return self._value

    @contextmanager
    def writeableArray(self) -> Iterator[NDArray[Any]]:
        yield self._value


class Object:
    def __init__(self, name: str, **data: Any) -> None:
        self._name = name
        for key, value in data.items():
            setattr(self, key, Data(value))

    def getName(self) -> str:
        return self._name
