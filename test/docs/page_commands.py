"""The commands of the documentation's pages, as a reader would type them.

A block of a page is shell code where it is indented by four spaces, or fenced as `sh` or without a language. Each has
to begin with a command that is known here, or to carry a marker, an HTML comment above it that the page's reader does
not see:

    <!-- not run: REASON -->    no test can run these commands; they are checked as they stand
    <!-- long -->               run by `scripts/test --long` only, and checked as they stand
    <!-- no commands -->        output of a program, or a protocol
    <!-- wait: home again -->   before the next command the robot comes home from its mission

A marker holds for the next block. `ID`, `FILE` and other words in capitals stand for something of the reader's. Inline
code that begins with a command is checked as it stands, and not run.
"""

from __future__ import annotations

import itertools
import re
import shlex
from collections.abc import Iterator
from dataclasses import dataclass

_ROS = (
    "roslaunch",
    "rosrun",
    "rosservice",
    "rostopic",
    "rosbag",
    "rosparam",
    "rosnode",
    "roscore",
    "rviz",
    "rqt_image_view",
)
_OTHERS = (
    ".",
    "cd",
    "cp",
    "make",
    "pytest",
    "python",
    "python3",
    ".ws/venv/bin/python",
    "export",
    "catkin_make",
    "arduino-cli",
)
PROGRAMS = frozenset(_ROS + _OTHERS)
_MARKER = re.compile(
    r"^ *<!-- *(not run: *(?P<reason>\S.*?)|(?P<long>long)|(?P<none>no commands)|wait: *(?P<wait>\S.*?)) *-->$"
)
_FENCE = re.compile(r"^ *```(\w*)$")
_INLINE = re.compile(r"(?<!`)`([^`\n]+)`(?!`)")
_SETTING = re.compile(r"\w+=")  # of a variable, before the program
_PLACEHOLDER = re.compile(r"[A-Z]+(_[A-Z]+)*")


@dataclass(frozen=True, kw_only=True)
class Command:
    """One command of a page.

    Attributes:
        page: file name.
        line: where it stands in the page, from 1.
        text: as typed, its comment included; may hold line breaks.
        mode: "run", "long", "not run" (with `reason`) or "inline".
        wait: what has to have happened before, "" for nothing.
    """

    page: str
    line: int
    text: str
    mode: str
    reason: str = ""
    wait: str = ""

    @property
    def typed(self) -> str:
        """As the shell takes it, without a comment at the end."""
        return re.sub(r"\s+#\s[^'\"]*$", "", self.text)

    @property
    def words(self) -> list[str]:
        """Words as the shell would split them, from the program on; variables and placeholders stand as they are."""
        words = shlex.split(self.text.replace("\\\n", " "), comments=True)
        return list(itertools.dropwhile(_SETTING.match, words))

    @property
    def has_placeholder(self) -> bool:
        """Whether a word in capitals stands for something of the reader's."""
        return any(_PLACEHOLDER.fullmatch(part) for word in self.words for part in re.split(r"[/:=|\[\].]+", word))

    @property
    def where(self) -> str:
        """Page and line, for messages."""
        return f"{self.page}:{self.line}"


class PageError(Exception):
    """A block that is neither commands nor marked."""


@dataclass(frozen=True)
class _Block:
    line: int
    lines: list[str]
    language: str
    mode: str
    reason: str
    wait: str


def commands_of(page: str, text: str) -> list[Command]:
    """All commands of a page, in its order.

    Args:
        page: name for messages.
        text: Markdown.

    Raises:
        PageError: a block that no marker explains does not begin with a known command.
    """
    found = list(_inline(page, text))
    for block in _blocks(text):
        if block.language in ("", "sh") and block.mode != "no commands":
            found += _of_block(page, block)
    return sorted(found, key=lambda command: command.line)


def is_command(line: str) -> bool:
    """Whether a line begins with a program that the pages let the reader type."""
    words = line.split()
    first = next(itertools.dropwhile(_SETTING.match, words), "")
    return first in PROGRAMS or bool(re.match(r"(scripts|\.ws/firmware)/\w+$", first))


def _inline(page: str, text: str) -> Iterator[Command]:
    blocks = {number for block in _blocks(text) for number in range(block.line, block.line + len(block.lines))}
    for number, line in enumerate(text.splitlines(), 1):
        if number in blocks:
            continue
        for code in _INLINE.findall(line):
            if is_command(code) and " " in code.strip():
                yield Command(page=page, line=number, text=code, mode="inline")


def _of_block(page: str, block: _Block) -> Iterator[Command]:
    typed, begin, found = "", block.line, False
    for number, line in enumerate(block.lines, block.line):
        line = line.removeprefix("    ")
        if not typed and (not line.strip() or line.lstrip().startswith("#")):
            continue
        begin = begin if typed else number
        typed += line + "\n"
        if not _is_complete(typed):
            continue
        if not is_command(typed):
            raise PageError(
                f"{page}:{begin}: '{line.strip()}' begins with no known command: put <!-- no commands --> or"
                f" <!-- not run: REASON --> above the block, or name its program in test/docs/page_commands.py"
            )
        yield Command(
            page=page,
            line=begin,
            text=typed.strip(),
            mode=block.mode,
            reason=block.reason,
            wait="" if found else block.wait,
        )
        typed, found = "", True
    if typed:
        raise PageError(f"{page}:{begin}: a quote or a line that goes on is not ended: {typed.strip()}")


def _is_complete(typed: str) -> bool:
    if typed.endswith("\\\n"):
        return False
    try:
        shlex.split(typed, comments=True)
    except ValueError:  # a quote that is still open
        return False
    return True


def _blocks(text: str) -> Iterator[_Block]:
    lines = text.splitlines()
    marks = {"mode": "run", "reason": "", "wait": ""}
    index = 0
    while index < len(lines):
        line, begin = lines[index], index
        index += 1
        if marker := _MARKER.match(line):
            marks |= _marks(marker)
        elif fence := _FENCE.match(line):
            while index < len(lines) and not _FENCE.match(lines[index]):
                index += 1
            yield _Block(begin + 2, lines[begin + 1 : index], fence[1], **marks)
            index += 1
            marks = {"mode": "run", "reason": "", "wait": ""}
        elif line.startswith("    ") and not _is_in_list(lines, begin):
            while index < len(lines) and (lines[index].startswith("    ") or not lines[index].strip()):
                index += 1
            yield _Block(begin + 1, lines[begin:index], "", **marks)
            marks = {"mode": "run", "reason": "", "wait": ""}
        elif line.strip():
            marks = {"mode": "run", "reason": "", "wait": ""}


def _marks(marker: re.Match[str]) -> dict[str, str]:
    if marker["wait"]:
        return {"wait": marker["wait"]}
    return {
        "mode": "not run" if marker["reason"] else "long" if marker["long"] else "no commands",
        "reason": marker["reason"] or "",
    }


def _is_in_list(lines: list[str], index: int) -> bool:
    """Whether an indented line goes on with the text above, as in a list's entry."""
    return index > 0 and bool(lines[index - 1].strip()) and not _MARKER.match(lines[index - 1])
