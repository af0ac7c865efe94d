"""Which texts there are, and which of them a language lacks; `make translations` adds and compiles them.

Texts stand in the code of both sides (`text("...")`, `N_("...")`), in templates (`_("...")`), in the report's
`texts.yaml`, in `visible_parameters.yaml` and in the effects. What the daemon and the reading of a log put together of
text and values are f-strings: each becomes a text with numbered places, so that a sentence that somebody adds is missed
until it is translated.
"""

from __future__ import annotations

import ast
import datetime
import io
import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import yaml
from babel import Locale
from babel.dates import get_day_names, get_month_names
from babel.messages.catalog import Catalog
from babel.messages.extract import extract_from_dir
from babel.messages.mofile import write_mo
from babel.messages.pofile import read_po, write_po

from igrow.core.effects import EFFECTS
from igrow.core.language import LANGUAGES
from igrow.core.language.sentences import PLACE
from tests.needs import ROOT

_CORE, _TRAINER, _EDGE = (ROOT / room for room in ("igrow_core", "trainer", "edge"))
_FOLDERS = (_CORE / "language", _TRAINER / "report", _TRAINER / "diagnosis", _TRAINER / "data", _EDGE / "page")
_METHODS = [("**.py", "python"), ("**.html", "jinja2.ext.babel_extract")]
_CREATED = datetime.datetime(2026, 11, 22, tzinfo=datetime.UTC)
"""A fixed day, so that a file changes with its texts alone."""
_KEYWORDS = {"text": None, "N_": None, "_": None}
_SPEAKING = (
    *(_EDGE / name for name in (
        "climate_alarms.py", "clock.py", "cycle.py", "daemon.py", "guard", "heart.py", "image.py", "journal.py",
        "overriding.py",
        "planning/forecast.py", "planning/make_plan.py", "planning/process.py", "planning/worker.py",
        "planning_schedule.py", "sensors", "separating_tests", "setpoint_statuses.py", "sources", "stopping.py",
        "updates", "hand_off.py", "bus/errors.py", "bus/opening.py", "bus/plc.py", "bus/request_slot.py",
        "exchange/mounted.py", "exchange/service.py", "exchange/sftp.py", "page/state.py", "status/client.py",
        "store/store.py", "store/ledger.py",
    )),
    _CORE / "separating_tests" / "definition.py",
    *(_TRAINER / name for name in (
        "data/plausibility", "data/rows.py", "data/screening.py", "diagnosis/crop.py", "diagnosis/diagnosed_days.py",
        "diagnosis/open_vents.py",
    )),
)  # fmt: skip
"""Files and folders whose f-strings and sentences people read on the page or in the report."""
_NO_TEXT = re.compile(
    r"PRAGMA|SELECT|INSERT|DELETE|CREATE|BEGIN|HTTP/|://|\.json|%[sYdH]|\n|^[./-]|^igrow-|category IN|"
    r"Connection closed|subsystem|canonicalize|mkdir|verification failed|HOST IDENT|Permission denied|No space left|"
    r"is known for|bad permissions|Load key|"
    r"^([ckM]?(J|W|Wh) [ck]?m-2|g m-3|kg ha-1 h-1|g m-2 h-1)$|"
    r"^(sensor|service|write|link|registers|bus|interlock|connect|aside:|put|get|rename) \{0\}"
)
_PATTERNS = {"short_day": "MMMd", "weekday": "Ed", "date": "MMMEd"}
"""What the page and the report write a date for -> CLDR's skeleton."""


def messages() -> list[str]:
    """Return every text in English, each once, in the order of their places."""
    found = [
        str(message)
        for folder in _FOLDERS
        for _, _, message, _, _ in extract_from_dir(folder, _METHODS, keywords=_KEYWORDS)
    ]
    for texts in _yaml("report/texts.yaml").values():
        found += texts.values()
    visible = _yaml("diagnosis/visible_parameters.yaml")
    found += [*visible["checks"].values(), *(title for title, _, _ in visible["visible"].values())]
    for effect in EFFECTS.values():
        texts = (effect.title, effect.sentence, effect.separating_test, effect.signature, effect.opposite)
        found += filter(None, texts)
    return list(dict.fromkeys([*found, *sentences()]))


def _yaml(name: str) -> dict[str, Any]:
    return dict(yaml.safe_load((_TRAINER / name).read_text(encoding="utf-8")))


def sentences() -> list[str]:
    """Return the texts that are put together of text and values, with numbered places, and those that go with them."""
    found: list[str] = []
    for place in _SPEAKING:
        for path in sorted(place.rglob("*.py")) if place.is_dir() else [place]:
            found += _sentences_of(ast.parse(path.read_text(encoding="utf-8")))
    return list(dict.fromkeys(found))


def _sentences_of(tree: ast.AST) -> Iterator[str]:
    silent = {id(inner) for node in ast.walk(tree) if _is_silent(node) for inner in ast.walk(node)}
    for node in ast.walk(tree):
        if id(node) in silent:
            continue
        if isinstance(node, ast.JoinedStr):
            silent |= {id(part) for part in node.values}
            message = _numbered(node)
        elif isinstance(node, ast.Constant) and isinstance(node.value, str) and " " in node.value.strip():
            message = node.value
        else:
            continue
        letters = sum(letter.isalpha() for letter in PLACE.sub("", message))
        if letters >= 2 and " " in message.strip() and not _NO_TEXT.search(message):
            yield message


def _numbered(node: ast.JoinedStr) -> str:
    """Return an f-string as a text with numbered places."""
    parts, places = [], 0
    for part in node.values:
        if isinstance(part, ast.Constant):
            parts.append(str(part.value))
        else:
            parts.append(f"{{{places}}}")
            places += 1
    return "".join(parts)


def _is_silent(node: ast.AST) -> bool:
    """Tell whether what stands in a piece of code is no such sentence: a docstring, a log line, a setting."""
    if isinstance(node, ast.Expr):
        return isinstance(node.value, ast.Constant)
    if isinstance(node, ast.Raise):
        return isinstance(node.exc, ast.Call) and getattr(node.exc.func, "id", "") == "SettingError"
    if isinstance(node, ast.Call):
        called = node.func
        if isinstance(called, ast.Attribute):
            return isinstance(called.value, ast.Name) and called.value.id in ("_log", "re", "parser")
        return isinstance(called, ast.Name) and called.id in ("setting", "N_", "say", "print")
    return False


def catalogue(language: str) -> Catalog:
    """Return what a language has."""
    with _file(language, "po").open("rb") as file:
        return read_po(file, language)


def update(language: str) -> list[str]:
    """Add the texts that a language lacks to its file, take out those that are gone; returns what is untranslated."""
    known = catalogue(language) if _file(language, "po").exists() else Catalog(language)
    fresh = Catalog(
        language,
        header_comment="# Texts of igrow.",
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
    with _file(language, "po").open("wb") as file:
        write_po(file, fresh, width=0, omit_header=False, no_location=True)
    return [str(one.id) for one in fresh if one.id and not one.string]


def compiled(language: str) -> bytes:
    """Return what a language has as GNU gettext reads it."""
    made = io.BytesIO()
    write_mo(made, catalogue(language))
    return made.getvalue()


def locales() -> str:
    """Return how each language writes numbers and dates, by CLDR, as JSON; English with the day first."""
    found = {}
    for code in LANGUAGES:
        locale = Locale.parse("en_GB" if code == "en" else code)
        signs = locale.number_symbols["latn"]
        patterns = {name: locale.datetime_skeletons[key].pattern for name, key in _PATTERNS.items()}
        moment = "y年M月d日 HH:mm" if code == "zh" else "d MMM y HH:mm"
        found[code] = {
            "decimal": signs["decimal"],
            "group": signs["group"],
            "months": [get_month_names("wide", locale=locale)[number] for number in range(1, 13)],
            "short_months": [get_month_names("abbreviated", locale=locale)[number] for number in range(1, 13)],
            "weekdays": [get_day_names("wide", locale=locale)[number] for number in range(7)],
            "short_weekdays": [get_day_names("abbreviated", locale=locale)[number] for number in range(7)],
            "patterns": {
                **patterns,
                "day": locale.date_formats["long"].pattern,
                "full": locale.date_formats["full"].pattern,
                "moment": moment,
            },
        }
    return json.dumps(found, indent=1, ensure_ascii=False) + "\n"


def numbered() -> str:
    """Return the texts with numbered places as JSON."""
    return json.dumps([one for one in messages() if PLACE.search(one)], indent=1, ensure_ascii=False) + "\n"


def _file(language: str, kind: str) -> Path:
    return _CORE / "language" / f"{language}.{kind}"


if __name__ == "__main__":
    for code in LANGUAGES[1:]:
        for missing in update(code):
            print(f"{code}.po: to be translated: {missing}")
        _file(code, "mo").write_bytes(compiled(code))
    (_CORE / "language" / "locales.json").write_text(locales(), encoding="utf-8")
    (_CORE / "language" / "sentences.json").write_text(numbered(), encoding="utf-8")
