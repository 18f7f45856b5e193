"""A page for each public module, made from the names in its ``__all__``.

Pictures of the README are on the site as well. Links from the manual to other files of
the repository are plain text there.
"""

import ast
import re
from pathlib import Path
from typing import Any

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files

PACKAGE = Path(__file__).parents[1] / "radarsim"
PAGES = {
    "radarsim": PACKAGE / "__init__.py",
    "radarsim.client": PACKAGE / "client" / "__init__.py",
    "radarsim.gym": PACKAGE / "addons" / "gym" / "__init__.py",
}
PICTURES = PACKAGE.parent / ".readme"
_PICTURE = re.compile(r"\]\(../../.readme/(\w+\.png)\)")
_LINK_TO_FILE = re.compile(r"\[([^\]]+)\]\((?:\.\./[^)]*|\w+\.ipynb)\)")


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the pages and the pictures to those of the manual."""
    for picture in PICTURES.glob("*.png"):
        path = f"pictures/{picture.name}"
        files.append(File.generated(config, path, abs_src_path=str(picture)))
    for module, source in PAGES.items():
        content = f"# {module}\n\n" + "\n\n".join(
            f"::: {module}.{name}" for name in _public_names(source)
        )
        path = f"reference/{module.removeprefix('radarsim.')}.md"
        files.append(File.generated(config, path, content=content))
    return files


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Lead links to what is on the site."""
    return _LINK_TO_FILE.sub(r"\1", _PICTURE.sub(r"](/pictures/\1)", markdown))


def _public_names(source: Path) -> list[str]:
    for node in ast.parse(source.read_text(encoding="utf-8")).body:
        if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "__all__":
            names: list[str] = ast.literal_eval(node.value)
            return [name for name in names if not name.startswith("_")]
    raise ValueError(f"{source} has no __all__")
