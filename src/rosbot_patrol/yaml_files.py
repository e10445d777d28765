"""Yaml files that people write: read strictly, with a sentence that names file and line where they are wrong."""

from __future__ import annotations

from collections.abc import Hashable
from pathlib import Path
from typing import Any

import yaml

from rosbot_patrol.errors import ParamError


class _StandsTwiceError(yaml.constructor.ConstructorError):
    pass


class _StrictLoader(yaml.SafeLoader):
    """A loader for which a key that stands twice is an error, where yaml itself keeps the last."""

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
    """The keys and values of a yaml file.

    Args:
        path: where it lies.
        keys: which keys it should have, for the message where it has none at all.
        is_secret: say nothing of what it holds.

    Raises:
        ParamError: it cannot be read or is no such yaml; names the file, and the line where there is one.
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
