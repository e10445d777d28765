"""Words of the pages in English and German, by gettext.

The English texts stand in the code. `locale/de.po` has the German ones. It is read at the start, so that nothing has to
be compiled. Texts of the robot itself, such as the reason of a verdict, are English in both.
"""

from __future__ import annotations

import gettext
import io
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path

from babel.messages.mofile import write_mo
from babel.messages.pofile import read_po

LOCALE = Path(__file__).resolve().parent / "locale"
LANGUAGES = ("en", "de")

Words = Callable[[str], str]


@lru_cache
def words_of(language: str) -> Words:
    """The function that gives a text in a language; English where there is no other."""
    file = LOCALE / f"{language}.po"
    if language not in LANGUAGES or not file.exists():
        return gettext.NullTranslations().gettext
    with file.open("rb") as source:
        catalogue = read_po(source, locale=language)
    compiled = io.BytesIO()
    write_mo(compiled, catalogue)
    compiled.seek(0)
    return gettext.GNUTranslations(compiled).gettext


def later(text: str) -> str:
    """The text itself: marks one that another place shows in the visitor's language."""
    return text


def language_of(accept: str) -> str:
    """The language that a browser asks for first, of those there are; "en" if it asks for none of them."""
    for part in accept.split(","):
        code = part.partition(";")[0].strip().lower().partition("-")[0]
        if code in LANGUAGES:
            return code
    return "en"
