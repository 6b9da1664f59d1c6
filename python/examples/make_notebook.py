"""Makes the notebook of the script beside it: ``# %%`` begins a cell, ``# %% [markdown]`` one of text.

    python python/examples/make_notebook.py            writes coil_to_recommendation.ipynb, executed, pictures inline
    python python/examples/make_notebook.py --plain    the same without running it
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parent
SCRIPT = HERE / "coil_to_recommendation.py"


def notebook() -> Any:
    """The script as a notebook that has not run."""
    import nbformat

    cells = []
    for part in SCRIPT.read_text(encoding="utf-8").split("# %%")[1:]:
        head, _, body = part.partition("\n")
        if "[markdown]" in head:
            text = "\n".join(line[2:] for line in body.strip().splitlines())
            cells.append(nbformat.v4.new_markdown_cell(text))
        else:
            cells.append(nbformat.v4.new_code_cell(body.strip()))
    for number, cell in enumerate(cells):
        cell["id"] = f"cell-{number:02}"
    made = nbformat.v4.new_notebook(cells=cells)
    made.metadata["kernelspec"] = {"name": "python3", "display_name": "Python 3", "language": "python"}
    return made


def executed(made: Any, folder: Path) -> Any:
    """The notebook after it has run in a folder, with its output."""
    import nbclient

    nbclient.NotebookClient(made, timeout=900, resources={"metadata": {"path": str(folder)}}).execute()
    for cell in made.cells:
        cell.get("metadata", {}).pop("execution", None)
    return made


def main() -> None:
    import nbformat

    made = notebook()
    if "--plain" not in sys.argv[1:]:
        made = executed(made, HERE.parents[1])
    nbformat.write(made, SCRIPT.with_suffix(".ipynb"))


if __name__ == "__main__":
    main()
