"""Compares the size of the project with the budget in ``weight.json``.

Called as ``weight.py [TEST_CPU_SECONDS]``. A figure above its budget is an error: make
room, or raise the budget in the same commit, with the reason in its message. Lower the
budget in each commit that makes the project smaller.
"""

import ast
import json
import sys
import time
from collections import Counter
from pathlib import Path

HERE = Path(__file__).parent
ROOT = HERE.parent
DOCUMENTED = ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef
ADDITIONS = 10_000_000  # of the loop by which the speed of a machine is compared


def lines_of_code(text: str, tree: ast.Module) -> int:
    """Count lines that are neither blank, comments, docstrings nor imports."""
    other = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import | ast.ImportFrom):
            other.update(range(node.lineno, (node.end_lineno or 0) + 1))
        elif isinstance(node, DOCUMENTED) and ast.get_docstring(node) is not None:
            docstring = node.body[0]
            other.update(range(docstring.lineno, (docstring.end_lineno or 0) + 1))
    return sum(
        number not in other and bool(line.strip()) and not line.lstrip().startswith("#")
        for number, line in enumerate(text.splitlines(), 1)
    )


def is_record(node: ast.AST) -> bool:
    """Return whether a node is a class that is a dataclass or a named tuple."""
    if not isinstance(node, ast.ClassDef):
        return False
    words = " ".join(map(ast.unparse, [*node.bases, *node.decorator_list]))
    return "dataclass" in words or "NamedTuple" in words


def weigh_python(folder: Path) -> Counter[str]:
    """Count modules, lines of code and records below a folder."""
    found: Counter[str] = Counter()
    for path in folder.rglob("*.py"):
        text = path.read_text(encoding="utf-8")
        tree = ast.parse(text)
        found["modules"] += 1
        found["code"] += lines_of_code(text, tree)
        found["records"] += sum(map(is_record, ast.walk(tree)))
    return found


def weigh_cpp(folder: Path) -> Counter[str]:
    """Count files and lines of C++ below a folder, without comments and includes."""
    found: Counter[str] = Counter()
    for path in (*folder.rglob("*.cpp"), *folder.rglob("*.hpp")):
        lines = map(str.strip, path.read_text(encoding="utf-8").splitlines())
        other = ("//", "/*", "*", "#include", "#pragma")
        found["modules"] += 1
        found["code"] += sum(
            bool(line) and not line.startswith(other) for line in lines
        )
    return found


def weigh() -> dict[str, int]:
    """Return all figures but the time of the tests."""
    package = ROOT / "radarsim"
    found = weigh_python(package) + weigh_cpp(package)
    tests = (
        path.read_text(encoding="utf-8") for path in (ROOT / "tests").rglob("*.py")
    )
    pages = (path.read_text(encoding="utf-8") for path in package.rglob("docs/*.md"))
    scripts = (ROOT / folder for folder in ("examples", "benchmarks"))
    return {
        "lines of code": found["code"],
        "modules": found["modules"],
        "records": found["records"],
        "folders": len([*package.glob("*/__init__.py")]),
        "loose modules": len([*package.glob("*.py")]),
        "lines of code of examples and benchmarks": sum(
            weigh_python(folder)["code"] for folder in scripts
        ),
        "lines of tests": sum(len(text.splitlines()) for text in tests),
        "words of the manual": sum(len(text.split()) for text in pages),
    }


def loop_seconds() -> float:
    """Return the processor time of a loop of additions, s; the smallest of three."""
    times = []
    for _ in range(3):
        started, total = time.process_time(), 0
        for number in range(ADDITIONS):
            total += number
        times.append(time.process_time() - started)
    return min(times)


def main() -> None:
    """Print each figure with its budget; fail where one is above it."""
    budget = json.loads((HERE / "weight.json").read_text(encoding="utf-8"))
    found: dict[str, float] = dict(weigh())
    if len(sys.argv) > 1:  # as multiples of a loop, which hold on any machine
        found["processor time of the tests, in loops of additions"] = round(
            float(sys.argv[1]) / loop_seconds()
        )
    for name, value in found.items():
        mark = "" if value <= budget[name] else "  ABOVE"
        sys.stdout.write(f"{value:8,} of {budget[name]:8,}  {name}{mark}\n")
    above = [name for name, value in found.items() if value > budget[name]]
    if above:
        sys.exit(f"above the budget in .ci/weight.json: {', '.join(above)}")


if __name__ == "__main__":
    main()
