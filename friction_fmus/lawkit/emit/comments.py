"""Comments in generated C."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable

_WIDTH = 96


def comment_text(text: str) -> str:
    """Return a text that neither ends a comment nor begins one, and contains no trigraph."""
    return text.replace("*/", "* /").replace("/*", "/ *").replace("//", "/ /").replace("??", "? ?")


def comment(text: str) -> str:
    """Return a C comment; further lines are indented."""
    return f"/* {textwrap.indent(comment_text(text), '   ').lstrip()} */"


def comment_lines(texts: Iterable[str]) -> list[str]:
    """Return one C comment for each text, divided into lines."""
    comments = [f"/* {comment_text(text)} */" for text in texts]
    return [line for text in comments for line in textwrap.wrap(text, _WIDTH, subsequent_indent="   ")]
