# SPDX-License-Identifier: Apache-2.0
"""Hop 5: what the nodes report, live, as numpy columns."""

from __future__ import annotations

import time
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Iterator, Optional, Union

import numpy as np
from numpy.typing import NDArray
import zmq
from google.protobuf.message import Message

from .links import Keys, Links, Subscription
from .session import session_links
from .wire import Kind, Refused, decode

NODES = {
    "device": Kind.DEVICE_TELEMETRY,
    "mofc": Kind.MOFC_TELEMETRY,
    "physics": Kind.PHYSICS_TELEMETRY,
}
_NAME = {kind: node for node, kind in NODES.items()}


def columns_of(batch: Message) -> dict[str, NDArray[Any]]:
    """The columns of a batch by field name, in the units of the name. Row i belongs to tick i.

    Vectors have shape (ticks, 3), orientations (ticks, 4), all others (ticks,). A column that the
    node left out is empty.
    """
    repeated = [field for field in batch.DESCRIPTOR.fields if field.label == field.LABEL_REPEATED]
    ticks = len(getattr(batch, repeated[0].name))
    columns = {}
    for field in repeated:
        values: NDArray[Any] = np.array(getattr(batch, field.name), dtype=_DTYPES[field.cpp_type])
        width = len(values) // ticks if ticks else 1
        columns[field.name] = values.reshape(ticks, width) if width > 1 else values
    return columns


def _dtypes() -> dict[int, type]:
    from google.protobuf.descriptor import FieldDescriptor as field

    return {
        field.CPPTYPE_DOUBLE: np.float64,
        field.CPPTYPE_FLOAT: np.float32,
        field.CPPTYPE_INT32: np.int32,
        field.CPPTYPE_INT64: np.int64,
        field.CPPTYPE_UINT32: np.uint32,
        field.CPPTYPE_UINT64: np.uint64,
    }


_DTYPES = _dtypes()


@dataclass
class Batch:
    """The ticks of about 20 ms of one node."""

    node: str  # device, mofc or physics
    side: str  # of the session; "" with one device
    columns: dict[str, NDArray[Any]]  # see columns_of(); the fields of telemetry.proto
    counters: Message  # since the start of the node; see telemetry.proto
    session_id: int  # another one: the node was restarted
    message: Message  # as received

    def __repr__(self) -> str:
        ticks = len(next(iter(self.columns.values()), ()))
        side = f", side {self.side}" if self.side else ""
        return f"<Batch of {self.node}{side}: {ticks} ticks, session {self.session_id:x}>"


def batch_of(node: str, message: Message) -> Batch:
    return Batch(
        node=node,
        side=message.side,
        columns=columns_of(message),
        counters=message.counters,
        session_id=message.header.session_id,
        message=message,
    )


class Telemetry:
    """Live telemetry of the nodes of a session, as a viewer receives it.

        with palpate.Telemetry("session.txtpb") as telemetry:
            for batch in telemetry:
                print(batch.node, batch.columns["sequence"][-1])

    With keys it needs viewer.key_secret. A slow reader loses batches; counters stay right.

    :param session: session file
    :param nodes: some of device, mofc, physics
    :param timeout_s: longest silence of all nodes while iterating, s; None: without end, with one warning
    :raises SetupError: wrong session or keys
    """

    _WARN_AFTER_S = 5.0

    def __init__(
        self,
        session: Union[str, Path],
        nodes: tuple[str, ...] = ("device", "mofc", "physics"),
        *,
        insecure: bool = False,
        timeout_s: Optional[float] = None,
    ) -> None:
        self._session = str(session)
        self._nodes = nodes
        self._timeout_s = timeout_s
        if not nodes or not set(nodes) <= set(NODES):
            raise ValueError(f"nodes = {nodes}: must be some of {', '.join(NODES)}")
        config = session_links(session, insecure)
        keys = Keys(config.key_folder, "viewer") if config.key_folder is not None else None
        self._links = Links(keys, insecure)
        self._is_closed = False
        self.refused = 0  # frames with an error
        endpoints = {
            (f"{node}_telemetry", getattr(side, f"{node}_telemetry", config.physics_telemetry)): node
            for side in config.sides
            for node in nodes
        }
        self._poller = zmq.Poller()
        self._subscriptions = []
        try:
            for (link, endpoint), node in endpoints.items():
                socket = self._links.open(link, endpoint, binds=False)
                self._poller.register(socket, zmq.POLLIN)
                self._subscriptions.append(Subscription(socket, (NODES[node],)))
        except BaseException:
            self._links.close()
            raise
        self._ready: list[zmq.Socket[bytes]] = []

    def __repr__(self) -> str:
        closed = ", closed" if self._is_closed else ""
        return f"<Telemetry of {self._session!r}: {', '.join(self._nodes)}{closed}>"

    def receive(self, timeout_s: float) -> Optional[Batch]:
        """The next batch, or None if none arrives in time."""
        deadline = time.monotonic() + timeout_s
        while not self._is_closed:
            for subscription in self._subscriptions:
                subscription.send_if_due()
            if not self._ready:
                left_ms = (deadline - time.monotonic()) * 1e3
                self._ready = [s for s, _ in self._poller.poll(round(max(0.0, min(50.0, left_ms))))]
            if batch := self._read():
                return batch
            if not self._ready and time.monotonic() >= deadline:
                return None
        return None

    def _read(self) -> Optional[Batch]:
        while self._ready:
            try:
                parts = self._ready[-1].recv_multipart(zmq.NOBLOCK)
            except zmq.Again:
                self._ready.pop()
                continue
            try:
                if len(parts) != 1:
                    raise Refused("malformed")
                kind, message = decode(parts[0], _NAME)
                return batch_of(_NAME[kind], message)
            except (Refused, ValueError):
                self.refused += 1
        return None

    def __iter__(self) -> Iterator[Batch]:
        """All batches, until close(). TimeoutError after `timeout_s` of silence."""
        heard_at = time.monotonic()
        is_warned = False
        while not self._is_closed:
            left_s = 1.0 if self._timeout_s is None else heard_at + self._timeout_s - time.monotonic()
            if batch := self.receive(min(1.0, max(0.0, left_s))):
                heard_at, is_warned = time.monotonic(), True
                yield batch
                continue
            silent_s = time.monotonic() - heard_at
            if self._timeout_s is not None and silent_s >= self._timeout_s:
                raise TimeoutError(self._hint(silent_s))
            if not is_warned and silent_s > self._WARN_AFTER_S:
                warnings.warn(self._hint(silent_s), stacklevel=2)
                is_warned = True

    def _hint(self, silent_s: float) -> str:
        refused = f", {self.refused} messages were refused" if self.refused else ""
        return (
            f"no telemetry for {silent_s:.1f} s{refused}: is `palpate launch {self._session}` running, with the "
            "same --set name and $PALPATE_RUN_DIR, by the same user, and with the same keys?"
        )

    def close(self) -> None:
        self._is_closed = True
        self._links.close()

    def __enter__(self) -> "Telemetry":
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()
