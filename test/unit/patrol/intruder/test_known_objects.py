"""The file of things that look like somebody."""

from __future__ import annotations

from pathlib import Path

import pytest

from rosbot_patrol.errors import ParamError
from rosbot_patrol.patrol.intruder.known_objects import KnownObject, KnownObjects, load_known


def write(folder: Path, text: str) -> Path:
    path = folder / "known.yaml"
    path.write_text(text, encoding="utf-8")
    return path


def test_things_by_place_reach_and_class(tmp_path: Path) -> None:
    path = write(
        tmp_path,
        "objects:\n"
        "  - {name: Gipsbüste im Flur, x: 2.1, y: -0.4, radius: 0.8, label: person}\n"
        "  - {name: coat stand, x: 1, y: 2}\n",
    )
    assert load_known(path) == (
        KnownObject(x=2.1, y=-0.4, radius=0.8, name="Gipsbüste im Flur", label="person"),
        KnownObject(x=1.0, y=2.0, radius=0.5, name="coat stand", label=""),
    )


def test_no_file_is_no_things() -> None:
    assert load_known("") == ()


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("objects: [{name: a, x: 1}]", "objects/0/y"),
        ("objects: [{name: a, x: .nan, y: 1}]", "objects/0/x"),
        ("objects: [{name: a, x: 1, y: 1, radius: 0}]", "objects/0/radius"),
        ("objects: [{name: '', x: 1, y: 1}]", "objects/0/name"),
        ('objects: [{name: "a\\nb", x: 1, y: 1}]', "objects/0/name"),
        ("objects: [{name: a, x: 1, y: 1}, statue]", "objects/1/"),
        ("objects: 3", "objects"),
        ("things: []", "objects"),
        ("objects: [", "known.yaml"),
        ("", "known.yaml"),
    ],
)
def test_what_is_wrong_is_said_with_file_and_key(tmp_path: Path, text: str, words: str) -> None:
    path = write(tmp_path, text)
    with pytest.raises(ParamError) as error:
        load_known(path)
    assert words in str(error.value)
    assert str(path) in str(error.value)


def test_a_file_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(ParamError, match=r"nowhere\.yaml"):
        load_known(tmp_path / "nowhere.yaml")


def test_the_consoles_file_is_read_again_when_it_changes(tmp_path: Path) -> None:
    own, path, said = tmp_path / "own.yaml", tmp_path / "known_objects.yaml", []
    own.write_text("objects:\n  - {name: statue, x: 0, y: 0}\n", encoding="utf-8")
    known = KnownObjects(str(own), path, said.append)
    assert [each.name for each in known()] == ["statue"]
    path.write_text("objects:\n  - {name: coat stand, x: 1.0, y: 2.0}\n", encoding="utf-8")
    assert [each.name for each in known()] == ["statue", "coat stand"]
    path.write_text("objects: nonsense\n", encoding="utf-8")
    assert [each.name for each in known()] == ["statue", "coat stand"]
    assert "objects" in said[-1]
    path.unlink()
    assert [each.name for each in known()] == ["statue"]
