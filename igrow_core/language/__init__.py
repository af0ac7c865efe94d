"""What igrow says to people, in their language: texts, names, numbers, dates and units, the same on both sides.

A text is written in English where it is used. `nl.po` and its neighbours hold it in the other languages, in the format
of GNU gettext; `make translations` adds to them whatever text is new and compiles them (`nl.mo`), and writes
`locales.json`, how each writes numbers and dates (Unicode CLDR). So a gateway needs Python's own gettext alone.
"""

from igrow.core.language.language import ENGLISH, LANGUAGES, Language, speak
from igrow.core.language.names import N_

__all__ = ["ENGLISH", "LANGUAGES", "N_", "Language", "speak"]
