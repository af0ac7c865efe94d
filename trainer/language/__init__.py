"""What the trainer says to people, in their language: texts, numbers, dates, units and names of things.

A text is written in English where it is used; `nl.po` and its neighbours hold it in the other languages, in the
format of GNU gettext. `make translations` adds to them whatever text is new.
"""

from igrow.trainer.language.language import ENGLISH, LANGUAGES, Language, speak

__all__ = ["ENGLISH", "LANGUAGES", "Language", "speak"]
