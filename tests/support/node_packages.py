"""Packages of npm for the tests that run a program of others under node."""

import os
import shutil
import subprocess
from pathlib import Path

import pytest


def install_packages(folder: Path, *packages: str) -> None:
    """Install packages; where that fails, tests fail in CI, and skip elsewhere."""
    npm, reason = shutil.which("npm"), ""
    if npm is None or shutil.which("node") is None:
        reason = "node or npm is not installed"
    else:
        words = [npm, "install", "--silent", "--no-audit", "--no-fund", *packages]
        done = subprocess.run(
            words, cwd=folder, capture_output=True, text=True, timeout=240, check=False
        )
        if done.returncode:
            reason = f"npm cannot install {', '.join(packages)}: {done.stderr[-300:]}"
    if not reason:
        return
    if os.environ.get("CI") == "true":
        pytest.fail(reason)
    pytest.skip(reason)
