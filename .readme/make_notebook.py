"""Make the notebook of the manual from its tutorial: run this without arguments.

Text stays text, and blocks of Python become cells, which run in a fresh kernel. Where a
program writes a picture into a file, its cell shows it.
"""

import base64
import io
import re
import sys
import tempfile
from pathlib import Path
from typing import Any

import nbformat
from nbclient import NotebookClient
from PIL import Image

MANUAL = Path(__file__).parents[1] / "radarsim" / "docs"
TUTORIAL = MANUAL / "tutorial.md"
NOTEBOOK = MANUAL / "tutorial.ipynb"
WIDTH = 1000  # pixels
COLOURS = 256

_PAGE_ONLY = re.compile(r"<!-- page -->\n.*?<!-- /page -->\n", re.DOTALL)
_COMMENT = re.compile(r"^<!--.*?-->\n", re.MULTILINE)
_PICTURE = re.compile(r"^!\[[^\]]*\]\([^)]*\)\n", re.MULTILINE)
_BLOCK = re.compile(r"^```(\w+)\n(.*?)^```\n", re.MULTILINE | re.DOTALL)
_FILE_NAME = re.compile(r"# (?P<name>[\w.]+)\n")
_WRITES_PICTURE = re.compile(r"^(\w+)\.(?:savefig|render)\(.*\)\n\Z", re.MULTILINE)


def make_cells(page: str) -> list[tuple[str, str]]:
    """Return the kind and the source of each cell: ``markdown`` or ``code``."""
    page = _PICTURE.sub("", _COMMENT.sub("", _PAGE_ONLY.sub("", page)))
    names = re.findall(r"^# (\w+)\.py$", page, re.MULTILINE)
    cells, text, end = [], "", 0
    for block in _BLOCK.finditer(page):
        text += page[end : block.start()]
        language, source = block.groups()
        end = block.end()
        if language == "python":
            code = _as_python_cell(source, names)
        elif language == "yaml":
            code = _FILE_NAME.sub(r"%%writefile \g<name>\n", source, count=1)
        else:  # what programs print, cells show
            text += block[0] if language == "sh" else ""
            continue
        cells += [("markdown", _tidy(text)), ("code", code.strip())]
        text = ""
    cells.append(("markdown", _tidy(text + page[end:])))
    return [(kind, source) for kind, source in cells if source]


def _tidy(text: str) -> str:
    return re.sub(r"\n{3,}", "\n\n", text).strip()


def _as_python_cell(source: str, modules: list[str]) -> str:
    """Return a program as a cell: what the cells before have defined is there."""
    source = _FILE_NAME.sub("", source, count=1)
    for module in modules:
        source = re.sub(rf"^from {module} import .*\n", "", source, flags=re.MULTILINE)
    shown = "plt.show()" if "pyplot" in source else r"\1"
    return _WRITES_PICTURE.sub(shown, source)


def make_notebook(page: str) -> Any:
    """Return the notebook of a page, not run yet."""
    notebook = nbformat.v4.new_notebook()
    for number, (kind, source) in enumerate(make_cells(page)):
        make = getattr(nbformat.v4, f"new_{kind}_cell")
        notebook.cells.append(make(source, id=f"cell-{number}"))
    notebook.metadata.kernelspec = {
        "display_name": "Python 3",
        "language": "python",
        "name": "python3",
    }
    return notebook


def run(notebook: Any) -> None:
    """Run all cells in a fresh kernel, in an empty folder."""
    with tempfile.TemporaryDirectory() as folder:
        resources = {"metadata": {"path": folder}}
        client = NotebookClient(
            notebook, timeout=600, resources=resources, record_timing=False
        )
        client.execute()
    notebook.metadata.language_info = {"name": "python"}


def shrink(notebook: Any) -> None:
    """Make pictures smaller: at most WIDTH pixels wide, and with a palette."""
    for output in (each for cell in notebook.cells for each in cell.get("outputs", [])):
        data = output.get("data", {})
        if "image/png" in data:
            picture = Image.open(io.BytesIO(base64.b64decode(data["image/png"])))
            picture = picture.convert("RGB")
            if picture.width > WIDTH:
                height = round(picture.height * WIDTH / picture.width)
                picture = picture.resize((WIDTH, height), Image.Resampling.LANCZOS)
            # by coverage, as the median cut leaves steps where rays lie close together
            picture = picture.quantize(COLOURS, Image.Quantize.MAXCOVERAGE, kmeans=4)
            file = io.BytesIO()
            picture.save(file, "PNG", optimize=True)
            data["image/png"] = base64.b64encode(file.getvalue()).decode()


def main() -> None:
    """Write the notebook, with what its cells show."""
    notebook = make_notebook(TUTORIAL.read_text(encoding="utf-8"))
    run(notebook)
    shrink(notebook)
    nbformat.validate(notebook)
    text = nbformat.writes(notebook)
    NOTEBOOK.write_text(text + "\n", encoding="utf-8")


if __name__ == "__main__":
    sys.exit(main())
