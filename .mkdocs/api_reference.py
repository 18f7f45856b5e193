"""A page for each public module, made from the names in its ``__all__``."""

import ast
from pathlib import Path

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files

PACKAGE = Path(__file__).parents[1] / "radarsim"
PAGES = {
    "radarsim": PACKAGE / "__init__.py",
    "radarsim.client": PACKAGE / "client" / "__init__.py",
    "radarsim.gym": PACKAGE / "addons" / "gym" / "__init__.py",
}


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the pages to those of the manual."""
    for module, source in PAGES.items():
        content = f"# {module}\n\n" + "\n\n".join(
            f"::: {module}.{name}" for name in _public_names(source)
        )
        path = f"reference/{module.removeprefix('radarsim.')}.md"
        files.append(File.generated(config, path, content=content))
    return files


def _public_names(source: Path) -> list[str]:
    for node in ast.parse(source.read_text(encoding="utf-8")).body:
        if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "__all__":
            names: list[str] = ast.literal_eval(node.value)
            return [name for name in names if not name.startswith("_")]
    raise ValueError(f"{source} has no __all__")
