"""Unit tests start no process and open no socket: those that do lie in test/process (docs/contributing.md)."""

from __future__ import annotations

import ast
from pathlib import Path

UNIT = Path(__file__).parent
PROCESS = UNIT.with_name("process")
FORBIDDEN = {
    "aiosmtpd",
    "asyncio",
    "http",
    "multiprocessing",
    "pty",
    "smtplib",
    "socket",
    "socketserver",
    "ssl",
    "subprocess",
    "xmlrpc",
}
STARTS = {"fork", "forkpty", "openpty", "popen", "posix_spawn", "posix_spawnp", "system"}  # of os


def imported(tree: ast.AST) -> set[str]:
    """First parts of the names of all modules that it imports."""
    names = [alias.name for node in ast.walk(tree) if isinstance(node, ast.Import) for alias in node.names]
    names += [node.module or "" for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)]
    return {name.partition(".")[0] for name in names}


def called(tree: ast.AST) -> set[str]:
    """`fork` where `os.fork` stands, and the like."""
    names = (node for node in ast.walk(tree) if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name))
    return {node.attr for node in names if node.value.id == "os"}


def test_no_unit_test_starts_a_process_or_opens_a_socket() -> None:
    servers = {path.stem for path in PROCESS.rglob("*.py")} - {"conftest"}
    found = {}
    for path in sorted(UNIT.rglob("*.py")):
        tree = ast.parse(path.read_text("utf-8"))
        if names := imported(tree) & (FORBIDDEN | servers) | called(tree) & STARTS:
            found[str(path.relative_to(UNIT))] = sorted(names)
    assert found == {}


def test_it_would_be_noticed() -> None:
    tree = ast.parse("import os, http.server\nfrom subprocess import run\nos.fork()")
    assert imported(tree) & FORBIDDEN == {"http", "subprocess"}
    assert called(tree) & STARTS == {"fork"}
    assert any(PROCESS.rglob("smtp_server.py"))
