"""Which texts there are, and which of them a language lacks; `python -m igrow.trainer.language.messages` adds them.

Texts stand in the trainer's code (`text("...")`, `N_("...")`), in the report's template (`_("...")`), in the effects.
"""

from __future__ import annotations

import datetime
from pathlib import Path

from babel.messages.catalog import Catalog
from babel.messages.extract import extract_from_dir
from babel.messages.pofile import read_po, write_po

from igrow.core.effects import EFFECTS
from igrow.trainer.language.language import LANGUAGES

_TRAINER = Path(__file__).parents[1]
_FOLDERS = ("language", "report", "diagnosis", "data")
_METHODS = [("**.py", "python"), ("**.html", "jinja2.ext.babel_extract")]
_CREATED = datetime.datetime(2026, 11, 22, tzinfo=datetime.UTC)
"""A fixed day, so that a file changes with its texts alone."""
_KEYWORDS = {"text": None, "N_": None, "_": None}


def messages() -> list[str]:
    """Return every text in English, each once, in the order of their places."""
    found = [
        str(message)
        for folder in _FOLDERS
        for _, _, message, _, _ in extract_from_dir(_TRAINER / folder, _METHODS, keywords=_KEYWORDS)
    ]
    for effect in EFFECTS.values():
        found += [effect.title, effect.sentence, effect.separating_test]
    return list(dict.fromkeys(found))


def catalogue(language: str) -> Catalog:
    """Return what a language has."""
    with _file(language).open("rb") as file:
        return read_po(file, language)


def update(language: str) -> list[str]:
    """Add the texts that a language lacks to its file, take out those that are gone; returns what is untranslated."""
    known = catalogue(language) if _file(language).exists() else Catalog(language)
    fresh = Catalog(
        language,
        header_comment="# Texts of igrow's trainer.",
        project="igrow",
        copyright_holder="igrow",
        msgid_bugs_address="-",
        last_translator="-",
        language_team="-",
        creation_date=_CREATED,
        revision_date=_CREATED,
        fuzzy=False,
    )
    for message in messages():
        before = known.get(message)
        fresh.add(message, before.string if before else "")
    with _file(language).open("wb") as file:
        write_po(file, fresh, width=0, omit_header=False, no_location=True)
    return [str(one.id) for one in fresh if one.id and not one.string]


def _file(language: str) -> Path:
    return Path(__file__).parent / f"{language}.po"


if __name__ == "__main__":
    for code in LANGUAGES[1:]:
        for missing in update(code):
            print(f"{code}.po: to be translated: {missing}")
