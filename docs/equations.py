"""Equations of the blocks, written as plain text in their files, as MathML.

A line has up to three columns: a condition that ends with a colon, the left-hand side, and the rest. What is not known
as an identifier, a number or an operator is shown as text.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Sequence
from html import escape
from typing import NamedTuple

GREEK = {
    **{"alpha": "α", "beta": "β", "gamma": "γ", "delta": "δ", "epsilon": "ε", "eps": "ε", "zeta": "ζ"},
    **{"eta": "η", "theta": "θ", "th": "θ", "iota": "ι", "kappa": "κ", "lam": "λ", "mu": "μ"},
    **{"nu": "ν", "xi": "ξ", "pi": "π", "rho": "ρ", "sigma": "σ", "tau": "τ", "phi": "φ"},
    **{"psi": "ψ", "omega": "ω", "Gamma": "Γ", "Delta": "Δ"},
}
FUNCTIONS = {
    *("exp", "ln", "log", "sin", "cos", "tan", "tanh", "asin", "asinh", "atan"),
    *("sgn", "sign", "clip", "min", "max", "round", "ceil", "sat", "diag"),
}
SHORT_WORDS = {"PI", "an", "as", "at", "be", "by", "if", "in", "is", "it", "no", "of", "on", "or", "so", "to"}
OPERATORS = {
    **{"<=": "≤", ">=": "≥", "!=": "≠", "/=": "≠", "=>": "⇒", "<-": "←", "...": "…", "-": "−", "*": "·"},
    **{symbol: symbol for symbol in "+/=<>()[]{}|,;:"},
}
DOTS = {"rd": "˙", "rdd": "¨"}
"""Derivatives of the reference."""
OPEN, CLOSE = "([{", ")]}"
SHORT = 14
"""Letters of the longest condition that stands beside its equation, not above."""
TOKEN = re.compile(
    r"""(?P<gap>(?<![-+=<>])\s{2,}(?![-+=<>])) | (?P<blank>\s+)
    | (?P<derivative>(?<![\w)])d(?P<order>\d?)(?P<of>[A-Za-z]\w*)/d(?P<by>[A-Za-z])(?P=order)(?!\w))
    | (?P<fraction>(?<![\w.)])\d+/\d+(?![\w.]))
    | (?P<number>\d+(?:\.\d+)?(?:e-?\d+)?)
    | (?P<root>sqrt\()
    | (?P<name>[A-Za-z][A-Za-z0-9]*(?:_[A-Za-z](?:[+-]\d)(?![\w.])|_[A-Za-z0-9]+|_\([^)]*\))*)
    | (?P<prime>'+) | (?P<power>\^) | (?P<operator><=|>=|!=|/=(?=\s)|=>|<-|\.\.\.|.)""",
    re.VERBOSE,
)


class Piece(NamedTuple):
    """MathML of one token; `kind` is that of the token, or ``word``."""

    kind: str
    markup: str


def equations(lines: Sequence[str], names: Collection[str]) -> str:
    """Return lines of equations as HTML with MathML; `names` are those of the variables of the block."""
    cells: list[tuple[str, str]] = []
    spans = False  # whether a line goes on under a left-hand side or under a line without one
    for line in lines:
        condition, left, right = columns(line)
        if not line.startswith(" "):
            spans = not left
        if condition and len(condition) > SHORT:
            cells.append(("whole", condition))
        cells.append(("condition", condition if len(condition) <= SHORT else ""))
        cells += [("both", right)] if spans and not left else [("left", left), ("right", right)]
    spans_of = "".join(f'<span class="{kind}">{formula(cell, names)}</span>' for kind, cell in cells)
    return f'<div class="equations" tabindex="0" role="group" aria-label="Equations">{spans_of}</div>'


def columns(line: str) -> tuple[str, str, str]:
    """Return the condition, the left-hand side, and the rest with the sign of equality."""
    if line.startswith(" "):
        indented = re.match(r"\s+([\w'|^()/+ ]{1,24}?)\s+(=\s.*)", line)
        return ("", indented[1], indented[2]) if indented else ("", "", line.strip())
    found = re.match(r"(.{1,60}?[^\s:]):\s+(.*)", line)
    if found and re.search(r"\s{3}|[,;]\s{2}", found[1]):
        found = None  # the colon belongs to a remark
    condition, rest = (f"{found[1]}:", found[2]) if found else ("", line)
    sides = re.match(r"([^=<>]{1,40}?)\s+((?:=|<-|becomes)\s.*)", rest)
    return (condition, sides[1], sides[2]) if sides else (condition, "", rest)


def formula(text: str, names: Collection[str]) -> str:
    """Return an expression as a MathML element; nothing if it is empty."""
    return f"<math>{''.join(piece.markup for piece in parsed(text.strip(), names))}</math>" if text.strip() else ""


def parsed(text: str, names: Collection[str]) -> list[Piece]:
    """Return the pieces of an expression."""
    pieces: list[Piece] = []
    position = 0
    while position < len(text):
        token = TOKEN.match(text, position)
        assert token
        position = token.end()
        kind = str(token.lastgroup if token.lastgroup not in ("of", "by", "order") else "derivative")
        if kind == "root":
            end = closing(text, position)
            pieces.append(Piece(kind, f"<msqrt>{joined(parsed(text[position:end], names))}</msqrt>"))
            position = end + 1
        elif kind == "power" and pieces:
            exponent, position = exponent_at(text, position)
            base = pieces.pop()
            above = "".join(piece.markup for piece in parsed(exponent, names))
            pieces.append(Piece(base.kind, f"<msup>{base.markup}<mrow>{above}</mrow></msup>"))
        elif kind == "prime" and pieces:
            base = pieces.pop()
            prime = f'<mo form="postfix" lspace="0" rspace="0">{"′" * len(token[0])}</mo>'
            pieces.append(Piece(base.kind, f"<mrow>{base.markup}{prime}</mrow>"))
        elif kind == "derivative":
            order = f"<mn>{token['order']}</mn>" if token["order"] else ""
            upper, lower = "<mi>d</mi>", identifier(token["by"])
            if order:
                upper, lower = f"<msup>{upper}{order}</msup>", f"<msup>{lower}{order}</msup>"
            above, below = f"{upper}{identifier(token['of'])}", f"<mi>d</mi>{lower}"
            pieces.append(Piece(kind, f"<mfrac><mrow>{above}</mrow><mrow>{below}</mrow></mfrac>"))
        elif kind == "name":
            pieces.append(named(token[0], text[position:], pieces, names))
        else:
            pieces.append(Piece(kind, simple(kind, token[0])))
    return with_articles(pieces)


def joined(pieces: Sequence[Piece]) -> str:
    """Return the pieces as one row."""
    return f"<mrow>{''.join(piece.markup for piece in pieces)}</mrow>"


def simple(kind: str, text: str) -> str:
    """Return the markup of a token that stands for itself."""
    if kind == "gap":
        return '<mspace width="1.5em"></mspace>'
    if kind == "blank":
        return '<mspace width="0.18em"></mspace>'
    if kind == "fraction":
        above, below = text.split("/")
        return f"<mfrac><mn>{above}</mn><mn>{below}</mn></mfrac>"
    if kind == "number":
        return f"<mn>{text}</mn>"
    if text == "|":
        return '<mo stretchy="false" lspace="0" rspace="0">|</mo>'
    if text in OPERATORS:
        return f'<mo stretchy="false">{escape(OPERATORS[text])}</mo>'
    return f"<mtext>{escape(text)}</mtext>"


def closing(text: str, position: int) -> int:
    """Return where the bracket closes that opens before a position."""
    depth = 1
    for at in range(position, len(text)):
        depth += (text[at] in OPEN) - (text[at] in CLOSE)
        if depth == 0:
            return at
    return len(text)


def exponent_at(text: str, position: int) -> tuple[str, int]:
    """Return the exponent that begins at a position, without its brackets, and where it ends."""
    if text[position] == "(":
        end = closing(text, position + 1)
        return text[position + 1 : end], end + 1
    found = re.compile(r"-?[A-Za-z0-9]+(?:_[A-Za-z0-9]+)?").match(text, position)
    assert found
    return found[0], found.end()


def named(name: str, rest: str, before: Sequence[Piece], names: Collection[str]) -> Piece:
    """Return a function, a sum, an identifier, or a word."""
    base = name.partition("_")[0]
    is_called = rest.startswith(("(", "^"))
    if base == "sum":
        sums = "_" in name or re.match(r"\s+(?!of\b)\(?[A-Za-z]{1,2}[_\W\d]", rest)
        index = name.partition("_")[2].strip("()")
        sign = '<mo stretchy="false">∑</mo>'
        below = "".join(piece.markup for piece in parsed(index, names)) if index else ""
        return Piece("name", f"<msub>{sign}<mrow>{below}</mrow></msub>" if index else sign) if sums else word(name)
    if name in FUNCTIONS and (is_called or re.match(r"\s+\w\b", rest)):
        return Piece("name", f"<mi>{name}</mi>")
    known = name in names or "_" in name or base.rstrip("0123456789") in GREEK or is_called
    long = len(base) > 2 and base.isalpha() and not (base[0].isupper() and len(base) == 3)
    if not known and (long or base in SHORT_WORDS) and base not in ("rdd", "dFi", "dzi"):
        return word(name)
    if name in ("ds", "dt", "dx") and name not in names:
        return Piece("name", f"<mi>d</mi><mi>{name[1]}</mi>")
    return Piece("name", identifier(name))


def word(text: str) -> Piece:
    """Return a word of a sentence."""
    return Piece("word", f"<mtext>{escape(text)}</mtext>")


def with_articles(pieces: list[Piece]) -> list[Piece]:
    """Return the pieces with the letter a between words as a word, and blanks beside words as wide as in text."""
    kinds = [piece.kind for piece in pieces]
    found = []
    for at, piece in enumerate(pieces):
        beside = [kinds[i] for i in (at - 2, at + 2) if 0 <= i < len(kinds)]
        if piece.markup == "<mi>a</mi>" and "word" in beside and "operator" not in beside:
            piece = word("a")
        if (
            piece.kind == "operator"
            and "-</mo>" in piece.markup.replace("−", "-")
            and kinds[at - 1 : at + 2 : 2] == ["word"] * 2
        ):
            piece = word("-")
        around = kinds[max(at - 1, 0) : at + 2 : 2]
        if piece.kind == "blank" and ("word" in around or around == ["number", "number"]):
            piece = Piece("blank", '<mspace width="0.3em"></mspace>')
        found.append(piece)
    return found


def identifier(name: str) -> str:
    """Return a name with its indices: ``sigma0``, ``F_hat``, ``Fc``, ``theta_i_next``, ``w_(j+1)``."""
    first, *given = re.findall(r"\([^)]*\)|[^_(]+", name)
    stem, number = re.fullmatch(r"([A-Za-z]+)(\w*)", first).groups() if first else ("", "")  # type: ignore[union-attr]
    indices = [number] if number else []
    greek = stem if stem in GREEK else stem[:-1] if len(stem) > 3 and stem[:-1] in GREEK else None
    if greek:
        letter = GREEK[greek]
        indices = ([stem[len(greek) :]] if stem != greek else []) + indices
    elif stem in DOTS:
        letter = stem[0]
    elif re.fullmatch("[A-Za-z]{2}|[A-Zd]..", stem) and first not in FUNCTIONS:
        letter, indices = stem[0], [stem[1:] + number]
    else:
        letter = stem
    symbol = f"<mi>{letter}</mi>"
    if stem in DOTS:
        symbol = f'<mover accent="true">{symbol}<mo stretchy="false">{DOTS[stem]}</mo></mover>'
    if "hat" in given:
        given.remove("hat")
        symbol = f'<mover accent="true">{symbol}<mo stretchy="false">^</mo></mover>'
    indices += [each.strip("()") for each in given]
    if not indices:
        return symbol
    shown = '<mo separator="true">,</mo>'.join(index(each) for each in indices)
    return f"<msub>{symbol}<mrow>{shown}</mrow></msub>"


def index(text: str) -> str:
    """Return an index: a number, a letter, a word, or a sum such as ``j+1``."""
    parts = re.findall(r"\d+|[A-Za-z]+|.", text)
    shown = []
    for part in parts:
        if part.isdigit():
            shown.append(f"<mn>{part}</mn>")
        elif part.isalpha():
            shown.append(f"<mi>{GREEK.get(part, part)}</mi>" if len(part) < 3 else f"<mtext>{part}</mtext>")
        else:
            shown.append(f"<mo>{escape(OPERATORS.get(part, part))}</mo>")
    return "".join(shown)
