"""Run the cells of examples/ambiguity.ipynb in order and store what they show.

    python tools/notebook.py          # writes the outputs
    python tools/notebook.py --check  # writes nothing; 1 if what is printed is not what is stored

Python alone, no Jupyter: a cell prints, and its last line is shown as text or, if it knows how, as a PNG.
"""

from __future__ import annotations

import ast
import base64
import contextlib
import io
import json
import sys
from pathlib import Path
from typing import Any

NOTEBOOK = Path(__file__).resolve().parents[1] / "examples" / "ambiguity.ipynb"


def outputs(notebook: dict[str, Any]) -> list[list[dict[str, Any]]]:
    """What each code cell shows, in Jupyter's form, run one after the other in one namespace."""
    space: dict[str, Any] = {"__name__": "__main__"}
    cells = [cell for cell in notebook["cells"] if cell["cell_type"] == "code"]
    return [shown("".join(cell["source"]), space, count) for count, cell in enumerate(cells, 1)]


def shown(source: str, space: dict[str, Any], count: int) -> list[dict[str, Any]]:
    """The outputs of one cell."""
    tree = ast.parse(source)
    last = tree.body.pop() if isinstance(tree.body[-1], ast.Expr) else None
    printed, value = io.StringIO(), None
    with contextlib.redirect_stdout(printed):
        exec(compile(tree, f"cell {count}", "exec"), space)  # noqa: S102 - our own file
        if isinstance(last, ast.Expr):
            value = eval(compile(ast.Expression(last.value), f"cell {count}", "eval"), space)  # noqa: S307
    found: list[dict[str, Any]] = []
    if printed.getvalue():
        text = printed.getvalue().splitlines(keepends=True)
        found.append({"name": "stdout", "output_type": "stream", "text": text})
    if value is not None:
        data = {"text/plain": [repr(value)]}
        if hasattr(value, "_repr_png_"):
            data["image/png"] = base64.b64encode(value._repr_png_()).decode() + "\n"
        found.append(
            {
                "data": data,
                "execution_count": count,
                "metadata": {},
                "output_type": "execute_result",
            }
        )
    return found


def told(cell_outputs: list[dict[str, Any]]) -> list[str]:
    """What a cell prints, without its pictures: their last bits belong to a machine."""
    return [line for output in cell_outputs for line in output.get("text", ())]


def main() -> int:
    notebook = json.loads(NOTEBOOK.read_text(encoding="utf-8"))
    cells = [cell for cell in notebook["cells"] if cell["cell_type"] == "code"]
    found = outputs(notebook)
    if "--check" in sys.argv[1:]:
        return int(any(told(c["outputs"]) != told(f) for c, f in zip(cells, found, strict=True)))
    for count, (cell, one) in enumerate(zip(cells, found, strict=True), 1):
        cell |= {"outputs": one, "execution_count": count}
    text = json.dumps(notebook, indent=1, ensure_ascii=False, sort_keys=True) + "\n"
    NOTEBOOK.write_text(text, encoding="utf-8")
    print(f"{NOTEBOOK.name}: {len(text) / 1000:.0f} kB")
    return 0


if __name__ == "__main__":
    sys.exit(main())
