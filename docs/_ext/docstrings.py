"""The docstrings of this project as reStructuredText: they are plain text, with `code`, sections and set-off formulas.

What stands beside a field of a dataclass, its shape and unit, is a comment in the source; here it becomes a list.
"""

from __future__ import annotations

import ast
import inspect
import re
import textwrap
from dataclasses import is_dataclass
from typing import Any

LISTED = ("Parameters", "Returns", "Raises", "Fields")
ENTRY = re.compile(r"(\*{0,2}[A-Za-z_][\w ,.]*?): +(.*)")


def setup(app: Any) -> dict[str, bool]:
    """Converts what autodoc has read."""
    app.connect("autodoc-process-docstring", _process)
    app.connect("autodoc-process-signature", _signature)
    return {"parallel_read_safe": True, "parallel_write_safe": True}


def _process(_app: Any, what: str, _name: str, thing: Any, _options: Any, lines: list[str]) -> None:
    text = converted(lines)
    if what in ("class", "exception") and is_dataclass(thing):
        text += fields(thing)
    lines[:] = text


class Written:
    """An annotation as it stands in the source."""

    def __init__(self, words: str) -> None:
        self.words = words

    def __repr__(self) -> str:
        return self.words


def _signature(
    _app: Any, what: str, _name: str, thing: Any, _options: Any, _signature: str | None, _returned: str | None
) -> tuple[str, str | None] | None:  # fmt: skip
    """`Array` and not what it stands for; nothing where a list of fields says it all."""
    if what == "class":
        return "", None
    if not inspect.isroutine(thing):
        return None  # as it is
    found = inspect.signature(thing)
    parameters = [
        one if one.annotation is one.empty else one.replace(annotation=Written(one.annotation))
        for one in found.parameters.values()
        if one.name != "self"
    ]
    words = str(found.replace(parameters=parameters, return_annotation=found.empty))
    return words, None if found.return_annotation is found.empty else found.return_annotation


def converted(lines: list[str]) -> list[str]:
    """Sections as headings with lists, indented blocks as they stand, the rest with nothing but `code` marked."""
    done: list[str] = []
    section = ""
    number = 0
    while number < len(lines):
        line = lines[number]
        if number + 1 < len(lines) and line.strip() and set(lines[number + 1].strip()) == {"-"}:
            section = line.strip()
            done += ["", f".. rubric:: {section}", ""]
            number += 2
        elif section in LISTED and line.strip():
            entry = [line.strip()]
            while number + 1 < len(lines) and lines[number + 1].startswith(" "):
                number += 1
                entry.append(lines[number].strip())
            done.append(_entry(" ".join(entry)))
            number += 1
        elif line.startswith("    ") and (not done or not done[-1].strip()):
            block = []
            while number < len(lines) and (
                lines[number].startswith("    ") or not lines[number].strip()
            ):
                block.append(lines[number])
                number += 1
            done += ["::", "", *block, ""]
        else:
            done.append(marked(line.strip()))
            number += 1
    return [*done, ""]


def _entry(text: str) -> str:
    """One line of a list: the name, then what is said of it."""
    found = ENTRY.fullmatch(text)
    return f"* ``{found[1]}``: {marked(found[2])}" if found else f"* {marked(text)}"


def marked(text: str) -> str:
    """`code` as literal text; everything else means nothing but itself."""
    parts = re.split(r"`+([^`]+)`+", text)
    return "".join(
        f"``{part}``" if number % 2 else re.sub(r"([\\*|_<>`\[\]])", r"\\\1", part)
        for number, part in enumerate(parts)
    )


def fields(kind: type) -> list[str]:
    """The fields of a dataclass, each with the comment on its line."""
    source = textwrap.dedent(inspect.getsource(kind))
    rows = source.splitlines()
    (body,) = (node.body for node in ast.parse(source).body if isinstance(node, ast.ClassDef))
    told = []
    for node in body:
        if isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name):
            last = rows[(node.end_lineno or node.lineno) - 1][node.end_col_offset or 0 :]
            comment = last.partition("#")[2].strip()
            kind_words = " ".join(ast.unparse(node.annotation).split())
            told.append(
                f"* ``{node.target.id}: {kind_words}``"
                + (f" -- {marked(comment)}" if comment else "")
            )
    return ["", ".. rubric:: Fields", "", *told, ""] if told else []
