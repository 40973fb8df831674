"""Makes office.ipynb from office.py: runs its cells and keeps what they show. Needs no Jupyter.

    python examples/notebook/build.py

office.py is plain Python in the percent format: "# %%" begins a cell of code, "# %% [markdown]" one of text. As in Jupyter, a
cell shows what it prints, its pictures, and the value of its last line unless that ends in a semicolon. Edit office.py and run
this again.
"""

from __future__ import annotations

import ast
import base64
import contextlib
import io
import json
import os
import re
import shutil
import sys
import tempfile
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parent
DOTS_PER_INCH = 110


def read_cells(path: Path) -> list[tuple[str, str]]:
    """(kind, source) of each cell, kind "markdown" or "code"."""
    parts = re.split(r"^# %%(.*)\n", path.read_text(encoding="utf-8"), flags=re.MULTILINE)
    cells: list[tuple[str, str]] = []
    for head, body in zip(parts[1::2], parts[2::2], strict=True):
        if "[markdown]" in head:
            cells.append(("markdown", re.sub(r"^# ?", "", body.strip(), flags=re.MULTILINE)))
        else:
            cells.append(("code", body.strip()))
    return cells


def run_cell(source: str, names: dict[str, Any]) -> list[dict[str, Any]]:
    """Run code as Jupyter does; returns the outputs of nbformat 4, without execution counts."""
    from matplotlib import pyplot as plt

    tree = ast.parse(source)
    last = tree.body.pop() if tree.body and isinstance(tree.body[-1], ast.Expr) else None
    printed, value = io.StringIO(), None
    with contextlib.redirect_stdout(printed), contextlib.redirect_stderr(io.StringIO()):
        exec(compile(tree, "<cell>", "exec"), names)
        if last is not None:
            value = eval(compile(ast.Expression(last.value), "<cell>", "eval"), names)
    outputs: list[dict[str, Any]] = []
    if text := printed.getvalue():
        outputs.append({"output_type": "stream", "name": "stdout", "text": lines(text)})
    if value is not None and not source.endswith(";"):
        data = {"text/plain": lines(repr(value))}
        if hasattr(value, "_repr_html_"):
            data["text/html"] = lines(value._repr_html_())
        outputs.append({"output_type": "execute_result", "data": data, "metadata": {}})
    for number in plt.get_fignums():
        data = {"image/png": picture(plt.figure(number)), "text/plain": ["<Figure>"]}
        outputs.append({"output_type": "display_data", "data": data, "metadata": {}})
    plt.close("all")
    return outputs


def picture(figure: Any) -> str:
    """A figure as PNG, in base64."""
    drawn = io.BytesIO()
    figure.savefig(drawn, format="png", dpi=DOTS_PER_INCH, bbox_inches="tight")
    return base64.b64encode(drawn.getvalue()).decode()


def lines(text: str) -> list[str]:
    """Text as nbformat keeps it."""
    return text.splitlines(keepends=True)


def run_notebook(cells: list[tuple[str, str]]) -> list[list[dict[str, Any]]]:
    """Outputs of each cell, in a folder of its own, beside a copy of the office."""
    import matplotlib as mpl
    import matplotlib.pyplot as plt

    mpl.use("agg")
    plt.close("all")  # figures that others left open are not of these cells
    names: dict[str, Any] = {"__name__": "__main__"}
    with tempfile.TemporaryDirectory() as scratch:
        shutil.copytree(HERE.parent / "office", Path(scratch) / "office")
        (Path(scratch) / "notebook").mkdir()
        before = Path.cwd()
        os.chdir(Path(scratch) / "notebook")
        try:
            return [run_cell(source, names) if kind == "code" else [] for kind, source in cells]
        finally:
            os.chdir(before)


def notebook(cells: list[tuple[str, str]], outputs: list[list[dict[str, Any]]]) -> dict[str, Any]:
    """A document of nbformat 4.5."""
    documents: list[dict[str, Any]] = []
    count = 0
    for index, ((kind, source), shown) in enumerate(zip(cells, outputs, strict=True)):
        cell: dict[str, Any] = {"cell_type": kind, "id": f"cell-{index}", "metadata": {}, "source": lines(source)}
        if kind == "code":
            count += 1
            results = [out | {"execution_count": count} if out["output_type"] == "execute_result" else out for out in shown]
            cell |= {"execution_count": count, "outputs": results}
        documents.append(cell)
    kernel = {"display_name": "Python 3", "language": "python", "name": "python3"}
    metadata = {"kernelspec": kernel, "language_info": {"name": "python"}}
    return {"cells": documents, "metadata": metadata, "nbformat": 4, "nbformat_minor": 5}


def main() -> None:
    cells = read_cells(HERE / "office.py")
    text = json.dumps(notebook(cells, run_notebook(cells)), indent=1, ensure_ascii=False) + "\n"
    (HERE / "office.ipynb").write_text(text, encoding="utf-8")
    print(f"{HERE / 'office.ipynb'}: {len(text) / 1000:.0f} kB", file=sys.stderr)


if __name__ == "__main__":
    main()
