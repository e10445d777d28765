from __future__ import annotations

import numpy as np
import pytest
from small_graph import GraphWriter, small_graph, weights

from rosbot_patrol.detection.ssd.graph_def import read_graph
from rosbot_patrol.errors import DetectorError


def test_constants_are_read_through_identities() -> None:
    graph = read_graph(small_graph(), "small.pb")
    for name, value in weights().items():
        assert np.array_equal(graph.constant(f"{name}/read"), value)


def test_one_value_fills_a_shape_and_integers_are_read() -> None:
    write = GraphWriter()
    for name, dtype, field, values in (("a", 1, "float_val", [0.5]), ("b", 3, "int_val", [300, 200])):
        tensor = write.message.node.add(name=name, op="Const").attr.add(key="value").value.tensor
        tensor.dtype = dtype
        tensor.tensor_shape.dim.add(size=2)
        getattr(tensor, field).extend(values)
    graph = read_graph(write.message.SerializeToString(), "two.pb")
    assert graph.constant("a").tolist() == [0.5, 0.5]
    assert graph.constant("b").tolist() == [300, 200]


def test_unknown_fields_are_skipped() -> None:
    # field 4 of a graph: its versions, here {producer: 24}
    assert len(read_graph(small_graph() + b"\x22\x02\x08\x18", "x")) == len(read_graph(small_graph(), "x"))


def test_order_ends_at_the_inputs_and_leaves_constants_out() -> None:
    graph = read_graph(small_graph(), "small.pb")
    names = [node.name for node in graph.order(["sum"], ["sub"])]
    assert [name for name in names if "/read" not in name] == ["conv", "norm", "relu", "depthwise", "out", "sum"]


@pytest.mark.parametrize("damaged", [b"\x0a\xff\x01abc", small_graph()[:-5], b"<html>not found</html>"])
def test_damaged_bytes_are_refused(damaged: bytes) -> None:
    with pytest.raises(DetectorError, match=r"people\.pb is no TensorFlow graph, or it is damaged"):
        read_graph(damaged, "people.pb")


def test_what_is_missing_or_no_constant_is_said() -> None:
    graph = read_graph(small_graph(), "small.pb")
    with pytest.raises(DetectorError, match=r"small\.pb has no operation nobody: it is another network"):
        graph.node("nobody")
    with pytest.raises(DetectorError, match="relu is a Relu6, expected a constant"):
        graph.constant("relu")
    with pytest.raises(DetectorError, match="the constant axis holds no numbers"):
        graph.constant("axis")


def test_a_constant_of_too_few_numbers_is_said() -> None:
    write = GraphWriter()
    write.constant("w", np.zeros((2, 3)))
    write.message.node[0].attr[0].value.tensor.tensor_shape.dim[0].size = 5
    graph = read_graph(write.message.SerializeToString(), "w.pb")
    with pytest.raises(DetectorError, match=r"w has 6 numbers for a shape of \[5, 3\]"):
        graph.constant("w")
