"""Reader of TensorFlow's frozen graphs (GraphDef) without TensorFlow.

The message classes are made here at run time, with the fields that a frozen network uses. Numbers and types are those
of TensorFlow's graph.proto, node_def.proto, attr_value.proto, tensor.proto and tensor_shape.proto (package
tensorflow/core/framework); protobuf skips all other fields.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
from google.protobuf.message import DecodeError
from numpy.typing import NDArray

from rosbot_patrol.errors import DetectorError

_PACKAGE = "frozen_graph"
_FIELDS = {  # message: (field, number, type or message, "*" in front: repeated)
    "Dim": [("size", 1, "int64")],
    "Shape": [("dim", 2, "*Dim")],
    "Tensor": [
        ("dtype", 1, "int32"),
        ("tensor_shape", 2, "Shape"),
        ("tensor_content", 4, "bytes"),
        ("float_val", 5, "*float"),
        ("int_val", 7, "*int32"),
    ],
    "List": [("i", 3, "*int64")],
    "Attr": [("list", 1, "List"), ("s", 2, "bytes"), ("f", 4, "float"), ("tensor", 8, "Tensor")],
    "Entry": [("key", 1, "string"), ("value", 2, "Attr")],
    "Node": [("name", 1, "string"), ("op", 2, "string"), ("input", 3, "*string"), ("attr", 5, "*Entry")],
    "Graph": [("node", 1, "*Node")],
}
_DTYPES = {1: ("<f4", "float_val"), 3: ("<i4", "int_val")}
"""TensorFlow's number of a type: numpy's name, and the field of single values."""


@dataclass(frozen=True)
class Node:
    """One operation of a graph.

    Args:
        name: unique in the graph; op: its kind.
        inputs: names of the nodes before it; an output's number (":1") stays in the name.
        attributes: messages with the fields `s`, `f`, `list` and `tensor`, by name.
    """

    name: str
    op: str
    inputs: tuple[str, ...]
    attributes: dict[str, Any]

    def text(self, key: str) -> str:
        """An attribute that is a word, "" if it is absent."""
        return self.attributes[key].s.decode() if key in self.attributes else ""

    def number(self, key: str) -> float:
        """An attribute that is a number; KeyError if it is absent."""
        return float(self.attributes[key].f)

    def integers(self, key: str) -> list[int]:
        """An attribute that is a list of integers, [] if it is absent."""
        return list(self.attributes[key].list.i) if key in self.attributes else []


class Graph:
    """A frozen graph.

    Args:
        nodes: its operations.
        source: where it comes from, for messages.
    """

    def __init__(self, nodes: Iterable[Node], source: str) -> None:
        self._nodes = {node.name: node for node in nodes}
        self.source = source

    def __len__(self) -> int:
        return len(self._nodes)

    def node(self, name: str) -> Node:
        """The node of that name; DetectorError if there is none."""
        try:
            return self._nodes[name]
        except KeyError:
            raise DetectorError(f"{self.source} has no operation {name}: it is another network") from None

    def behind(self, name: str) -> Node:
        """The first node on the way up from `name` that is no Identity."""
        node = self.node(name)
        while node.op == "Identity":
            node = self.node(node.inputs[0])
        return node

    def constant(self, name: str) -> NDArray[Any]:
        """Value of a constant, through any Identity before it.

        Raises:
            DetectorError: the node is no constant, or its bytes do not fit its shape.
        """
        node = self.behind(name)
        if node.op != "Const":
            raise DetectorError(f"{self.source}: {node.name} is a {node.op}, expected a constant")
        return _array(node, self.source)

    def order(self, outputs: Sequence[str], inputs: Sequence[str]) -> list[Node]:
        """List the nodes between `inputs` and `outputs`, each after those that it needs, without constants."""
        done, ordered = set(inputs), []
        waiting = [(name, False) for name in reversed(outputs)]
        while waiting:
            name, is_ready = waiting.pop()
            if name in done:
                continue
            node = self.node(name)
            if is_ready or node.op == "Const":
                done.add(name)
                if node.op != "Const":
                    ordered.append(node)
                continue
            waiting.append((name, True))
            waiting += [(before, False) for before in reversed(node.inputs)]
        return ordered


def read_graph(data: bytes, source: str) -> Graph:
    """Read the bytes of a GraphDef file.

    Raises:
        DetectorError: they are damaged.
    """
    try:
        message = GraphMessage.FromString(data)
    except DecodeError as err:
        raise DetectorError(f"{source} is no TensorFlow graph, or it is damaged: {err}") from err
    nodes = [
        Node(node.name, node.op, tuple(node.input), {entry.key: entry.value for entry in node.attr})
        for node in message.node
    ]
    return Graph(nodes, source)


def _array(node: Node, source: str) -> NDArray[Any]:
    tensor = node.attributes["value"].tensor if "value" in node.attributes else None
    if tensor is None or tensor.dtype not in _DTYPES:
        raise DetectorError(f"{source}: the constant {node.name} holds no numbers")
    dtype, field = _DTYPES[tensor.dtype]
    shape = [dim.size for dim in tensor.tensor_shape.dim]
    content = (
        np.frombuffer(tensor.tensor_content, dtype)
        if tensor.tensor_content
        else np.array(getattr(tensor, field), dtype)
    )
    if content.size == 1:
        return np.full(shape, content[0])
    if content.size != np.prod(shape):
        raise DetectorError(f"{source}: the constant {node.name} has {content.size} numbers for a shape of {shape}")
    return content.reshape(shape)


def _message_classes() -> dict[str, Any]:
    """Classes of the messages in `_FIELDS`."""
    kinds = descriptor_pb2.FieldDescriptorProto
    file = descriptor_pb2.FileDescriptorProto(name=f"{_PACKAGE}.proto", package=_PACKAGE, syntax="proto3")
    for message, fields in _FIELDS.items():
        described = file.message_type.add(name=message)
        for name, number, kind in fields:
            label = kinds.LABEL_REPEATED if kind.startswith("*") else kinds.LABEL_OPTIONAL
            field = described.field.add(name=name, number=number, label=label)
            kind = kind.lstrip("*")
            if kind in _FIELDS:
                field.type, field.type_name = kinds.TYPE_MESSAGE, f".{_PACKAGE}.{kind}"
            else:
                field.type = kinds.Type.Value(f"TYPE_{kind.upper()}")
    pool = descriptor_pool.DescriptorPool()
    pool.Add(file)
    return {name: message_factory.GetMessageClass(pool.FindMessageTypeByName(f"{_PACKAGE}.{name}")) for name in _FIELDS}


GraphMessage = _message_classes()["Graph"]
"""Message class of a whole graph."""
