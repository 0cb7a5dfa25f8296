# SPDX-License-Identifier: Apache-2.0
from typing import Any

from Sofa import Object


class Node:
    def __init__(self, name: str) -> None:
        self.name = name

    def addChild(self, name: str) -> "Node":
        child = Node(name)
        setattr(self, name, child)
        return child

    def addObject(self, kind: str, name: str, **data: Any) -> Object:
        added = Object(name, **data)
        setattr(self, name, added)
        return added
