"""Yaml files written by people: read strictly; errors name file and line."""

from __future__ import annotations

from collections.abc import Hashable
from pathlib import Path
from typing import Any

import yaml

from rosbot_patrol.errors import ParamError


class _StandsTwiceError(yaml.constructor.ConstructorError):
    pass


class _StrictLoader(yaml.SafeLoader):
    """A loader that rejects duplicate keys, while yaml itself keeps the last."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Hashable, Any]:
        seen: set[object] = set()
        for key_node, _ in node.value:
            if isinstance(key_node, yaml.ScalarNode) and key_node.tag != "tag:yaml.org,2002:merge":
                key = self.construct_object(key_node)  # 1 and 01 are one key
                if key in seen:
                    raise _StandsTwiceError(None, None, f"the key '{key_node.value}' stands twice", key_node.start_mark)
                seen.add(key)
        return super().construct_mapping(node, deep)


def read_mapping(path: str | Path, *, keys: str, is_secret: bool = False) -> dict[str, Any]:
    """Read the keys and values of a yaml file.

    Args:
        path: of the file.
        keys: expected keys, for the message if it has none.
        is_secret: keep its contents out of messages.

    Raises:
        ParamError: it cannot be read or is no mapping; names the file, and the line if there is one.
    """
    path = Path(path)
    try:
        text = path.read_text(encoding="utf-8")
    except UnicodeDecodeError as err:
        raise ParamError(str(path), f"is no text in UTF-8 ({err.reason} at byte {err.start})") from err
    except OSError as err:
        raise ParamError(str(path), f"cannot be read: {err.strerror}") from err
    try:
        tree = yaml.load(text, _StrictLoader)
    except yaml.MarkedYAMLError as err:
        mark = err.problem_mark
        where = f" at line {mark.line + 1}, column {mark.column + 1}" if mark else ""
        problem = err.problem
        if is_secret:
            problem = "a key stands twice" if isinstance(err, _StandsTwiceError) else "it cannot be parsed"
        raise ParamError(str(path), f"is no valid yaml{where}: {problem}") from (None if is_secret else err)
    except yaml.YAMLError as err:
        problem = "it cannot be parsed" if is_secret else " ".join(str(err).split())
        raise ParamError(str(path), f"is no valid yaml: {problem}") from (None if is_secret else err)
    if not isinstance(tree, dict):
        got = "something else" if is_secret else repr(str(tree)[:40])
        raise ParamError(str(path), f"expected the keys {keys}, got {got}")
    return tree
