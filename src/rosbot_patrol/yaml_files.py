"""Yaml files that people write: read strictly, with a sentence that names file and line where they are wrong."""

from __future__ import annotations

from collections.abc import Hashable
from pathlib import Path
from typing import Any

import yaml

from rosbot_patrol.errors import ParamError


class _StrictLoader(yaml.SafeLoader):
    """A loader for which a key that stands twice is an error, where yaml itself keeps the last."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Hashable, Any]:
        seen: set[object] = set()
        for key_node, _ in node.value:
            if isinstance(key_node, yaml.ScalarNode) and key_node.tag != "tag:yaml.org,2002:merge":
                if key_node.value in seen:
                    raise yaml.constructor.ConstructorError(
                        None, None, f"the key '{key_node.value}' stands twice", key_node.start_mark
                    )
                seen.add(key_node.value)
        return super().construct_mapping(node, deep)


def read_mapping(path: str | Path, *, keys: str) -> dict[str, Any]:
    """The keys and values of a yaml file.

    Args:
        path: where it lies.
        keys: which keys it should have, for the message where it has none at all.

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
        raise ParamError(str(path), f"is no valid yaml{where}: {err.problem}") from err
    except yaml.YAMLError as err:
        raise ParamError(str(path), f"is no valid yaml: {' '.join(str(err).split())}") from err
    if not isinstance(tree, dict):
        raise ParamError(str(path), f"expected the keys {keys}, got {str(tree)[:40]!r}")
    return tree
