"""Comments in generated C."""

from __future__ import annotations

import textwrap


def comment_text(text: str) -> str:
    """Return a text that neither ends a comment nor begins one, and contains no trigraph."""
    return text.replace("*/", "* /").replace("/*", "/ *").replace("//", "/ /").replace("??", "? ?")


def comment(text: str) -> str:
    """Return a C comment; further lines are indented."""
    return f"/* {textwrap.indent(comment_text(text), '   ').lstrip()} */"
