"""docs/sensors.md names tests; they exist."""

import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]


def test_every_test_that_the_docs_name_is_there():
    sources = "\n".join(path.read_text() for path in (ROOT / "test").glob("**/test_*.py"))
    there = set(re.findall(r"def (test_\w+)", sources)) | {path.stem for path in (ROOT / "test").glob("**/test_*.py")}
    named = set(re.findall(r"\btest_\w+", (ROOT / "docs/sensors.md").read_text()))
    assert len(named) > 50
    assert named - there == set()
