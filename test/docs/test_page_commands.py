"""What of a page is a command, and in which way it runs."""

from __future__ import annotations

import pytest
from page_commands import PageError, commands_of


def texts(page: str) -> list[tuple[str, str]]:
    return [(command.mode, command.text) for command in commands_of("page.md", page)]


def test_indented_and_fenced_blocks_are_commands() -> None:
    page = (
        "Type\n\n    rosrun a b      # why\n    . scripts/env\n\nor\n\n```sh\nrosbag info x\n```\n\n```\nroscore\n```\n"
    )
    assert texts(page) == [
        ("run", "rosrun a b      # why"),
        ("run", ". scripts/env"),
        ("run", "rosbag info x"),
        ("run", "roscore"),
    ]


def test_other_languages_lists_and_tables_are_none() -> None:
    page = "```yaml\nrosrun: 1\n```\n\n- a list\n    rosrun that goes on\n\n| `roslaunch` |\n"
    assert texts(page) == []


def test_lines_that_go_on_are_one_command() -> None:
    (one, two) = commands_of(
        "page.md", '    roslaunch a \\\n        b:=1\n    rostopic pub /t T "id: 1\n    move: 1"\n'
    )
    assert one.words == ["roslaunch", "a", "b:=1"]
    assert two.words == ["rostopic", "pub", "/t", "T", "id: 1\nmove: 1"]
    assert (one.where, two.where) == ("page.md:1", "page.md:3")


def test_a_marker_holds_for_the_next_block_only() -> None:
    page = (
        "<!-- not run: needs a robot -->\n\n    rosrun a b\n    rosrun c d\n\ntext\n\n    rosrun e f\n\n"
        "<!-- long -->\n```sh\nroscore\n```\n<!-- long -->\n\ntext between\n\n    roscore -p 1\n"
    )
    assert texts(page) == [
        ("not run", "rosrun a b"),
        ("not run", "rosrun c d"),
        ("run", "rosrun e f"),
        ("long", "roscore"),
        ("run", "roscore -p 1"),
    ]
    assert commands_of("page.md", page)[0].reason == "needs a robot"


def test_markers_add_up() -> None:
    page = "<!-- wait: home again -->\n<!-- long -->\n\n    rosrun a b\n    rosrun c d\n"
    assert [(c.mode, c.wait) for c in commands_of("p", page)] == [("long", "home again"), ("long", "")]


def test_a_block_that_is_neither_is_refused_by_its_line() -> None:
    with pytest.raises(PageError, match=r"page\.md:3: 'On guard' begins with no known command"):
        texts("It says\n\n    On guard\n")
    assert texts("It says\n\n<!-- no commands -->\n\n    On guard\n") == []


def test_a_marker_without_a_reason_is_none() -> None:
    assert texts("<!-- not run: -->\n\n    rosrun a b\n") == [("run", "rosrun a b")]


def test_an_open_quote_is_refused() -> None:
    with pytest.raises(PageError, match="not ended"):
        texts('    rosrun a "b\n')


def test_inline_commands_are_listed_apart() -> None:
    assert texts("Call `rosservice call /x`, or `rosrun`, see `config/x.yaml`.") == [("inline", "rosservice call /x")]


@pytest.mark.parametrize(
    ("text", "is_for_the_reader"),
    [
        ("rosrun a b FILE", True),
        ("roslaunch a b urdf:=FILE", True),
        ("roslaunch a b x:=$PWD/y", False),
        ("scripts/x", False),
    ],
)
def test_words_in_capitals_stand_for_the_readers(text: str, is_for_the_reader: bool) -> None:
    (command,) = commands_of("page.md", f"    {text}\n")
    assert command.has_placeholder == is_for_the_reader


def test_what_is_typed_has_no_comment() -> None:
    (command,) = commands_of("page.md", "    rosrun a b 'c # d'     # e\n")
    assert command.typed == "rosrun a b 'c # d'"
