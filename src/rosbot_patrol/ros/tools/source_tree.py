"""Generator of docs/architecture.md's tree of folders, from the packages' docstrings."""

from __future__ import annotations

import ast
from pathlib import Path

BEGIN, END = "<!-- tree: begin -->\n", "<!-- tree: end -->\n"


def with_tree(page: str, source: Path) -> str:
    """Replace the tree between the page's two markers by the folders below `source`.

    Raises:
        ValueError: the page lacks a marker.
    """
    before, begin, rest = page.partition(BEGIN)
    _, end, after = rest.partition(END)
    if not begin or not end:
        raise ValueError(f"the page needs the lines {BEGIN.strip()} and {END.strip()}")
    return f"{before}{BEGIN}\n{tree(source)}\n{END}{after}"


def tree(source: Path) -> str:
    """One table row per package, with the first line of its docstring."""
    rows = ["| folder | what it is |", "|---|---|"]
    for init in sorted(source.rglob("__init__.py"), key=lambda path: path.parent.parts):
        place = init.parent.relative_to(source)
        if place.parts:
            name = f"`{place}/`" if len(place.parts) > 1 else f"**`{place}/`**"
            rows.append(f"| {name} | {_first_line(init)} |")
    return "\n".join(rows) + "\n"


def _first_line(init: Path) -> str:
    text = ast.get_docstring(ast.parse(init.read_text(encoding="utf-8"))) or ""
    return text.partition("\n")[0]
