"""Sentences that read as if they were translated: ``python tests/docs/wording.py`` lists the candidates.

The text is that of pages, notebooks, docstrings, messages, comments of blocks, and JavaScript.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[2]
FOLDERS = {
    ".": ("README.md", "CONTRIBUTING.md"),
    "docs": ("*.md", "**/*.md", "**/*.js", "*.py", "**/*.html"),
    "examples": ("**/*.py", "**/*.ipynb", "**/*.toml"),
    "benchmarks": ("*.py",),
    "friction_fmus": ("**/*.py", "**/*.html", "**/*.js", "**/*.bib"),
    "harness": ("**/*.py",),
    "fmu_src": ("*/*.c",),
}
PATTERNS = {
    "a ratio is relative to, not over": r"\bover (that|those|the one)\b|\bover (plain|without)\b"
    r"|over the presliding|\bover its rms\b",
    "FMI 2.0 FMUs, third-party FMUs": r"FMUs? of (FMI|other tools|another tool|any tool)|of FMI \d\.\d and \d",
    "estimates the error": r"\b(tells?|says?) how far\b|\bhow far \w+ (variable|result|measure)s? (is|are) off\b",
    "a noun, not a clause": r"\ball that (nothing|no)\b|\bwhat it lacks\b|\bwhat no \w+|\bwhat the headings\b"
    r"|\binputs? that nothing drives\b|\bthat nothing drives\b|\bwhat a \w+ (lacks|accepts)\b",
    "for steps of 2 ms or longer, not from ... on": r"\bfrom (-?[\d.]+ ?\w*|rest) on\b",
    "a string, not a text": r"\b(carries|carry) no texts?\b|\*\*Texts\.",
    "test vocabulary": r"\bbefore each landing\b|\blast night\b",
    "one column says what was checked": r"\bfrom memory\b"
    r"|\b(paper|papers|sources?) (itself )?(was|were) not read\b|\bhave not been tried\b|\bnot all sources\b",
    "a deflection, a target, a step": r"\byields? like a spring\b|\bcontact yields\b|\bpresliding distance\b"
    r"|\bstops short of (its|the) goal\b|\bon each rung\b|\bmotion feedforward\b|\bcases that count\b",
    "an idiom of its own": r"\bso many\b|\blikewise\b|\bin our words\b|\bmay be below Fc\b"
    r"|\bwhen it is made\b|\bpush(es)? the axis out of rest\b|\b(at rest|is|by|and|vigorously) shaken\b",
}
"""What to write -> what not to write."""


def texts() -> Iterator[tuple[Path, str]]:
    """Yield the files with their text; of a notebook, its cells."""
    seen = set()
    for folder, globs in FOLDERS.items():
        for path in (path for glob in globs for path in sorted((ROOT / folder).glob(glob))):
            if path in seen or "live/uplot" in path.as_posix():
                continue
            seen.add(path)
            text = path.read_text(encoding="utf-8")
            if path.suffix == ".ipynb":
                text = "\n\n".join("".join(cell["source"]) for cell in json.loads(text)["cells"])
            yield path, text


def candidates() -> list[str]:
    """Return every place where a pattern occurs, across the ends of lines."""
    found = []
    for path, text in texts():
        flat = re.sub(r"\n[ \t#*>]*", lambda match: " " + "\0" * (len(match[0]) - 1), text)
        for advice, pattern in PATTERNS.items():
            for match in re.finditer(pattern.replace(" ", r"[ \0]+"), flat, re.I):
                line = text.count("\n", 0, match.start()) + 1
                found.append(
                    f"{path.relative_to(ROOT)}:{line}: '{' '.join(match[0].replace(chr(0), '').split())}': {advice}"
                )
    return found


if __name__ == "__main__":
    print("\n".join(candidates()))
