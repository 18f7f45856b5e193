"""Compile the engine with the compiler in the package ``ziglang``, a wheel of PyPI.

``hatch_build.py`` does so when the package is built or installed; in a checkout, this
file can be run: ``python radarsim/engine/build.py [COMPILER]``. It imports nothing of
radarsim.
"""

import hashlib
import os
import platform
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Final

FOLDER: Final = Path(__file__).parent
LIBRARY: Final = FOLDER / "libradarsim.so"

FLAGS: Final = (
    "-std=c++20 -O3 -shared -fPIC -Wall -Wextra -Werror -fvisibility=hidden"
    " -fno-exceptions -fno-rtti -fno-threadsafe-statics"
    # The same bits on each processor: a product and a sum stay two operations.
    " -ffp-contract=off"
    # Square roots set no errno, so that loops with them are computed in vectors.
    " -fno-math-errno"
)
# "zig cc" reads C++ as well; "zig c++" would build its standard library first. Old
# enough a glibc for manylinux_2_17.
ZIG: Final = (
    *("-m", "ziglang", "cc", "-s", "-target", "x86_64-linux-gnu.2.17"),
    # A ray passes through a dozen functions, whose calls take a tenth of its time.
    *("-mllvm", "-inline-threshold=4000", "-fomit-frame-pointer"),
    # Coordinates that were just written one by one are slow to read in pairs.
    "-fno-slp-vectorize",
)


def source_digest() -> str:
    """Return a digest of the engine's sources; they have to be there."""
    digest = hashlib.sha256(" ".join((FLAGS, *ZIG)).encode())
    for path in sorted(FOLDER.glob("*.[ch]pp")):
        digest.update(path.name.encode() + path.read_bytes())
    return digest.hexdigest()[:16]


def compile_engine(target: Path = LIBRARY, *compiler: str) -> None:
    """Compile the engine.

    Args:
        target: The library to be written; it is replaced once it is complete.
        compiler: A command, with options of its own; by default that of ``ziglang``.

    Raises:
        SystemExit: If there is no compiler, or it reports an error.
    """
    if platform.machine() != "x86_64" or sys.platform != "linux":
        sys.exit(
            "radarsim runs on Linux on x86-64, for which embreex and this package are"
            f" tested, not on {sys.platform} on {platform.machine()}"
        )
    command = compiler or (sys.executable, *ZIG, "-mcpu=x86_64_v2")
    new = target.with_suffix(f".{os.getpid()}")  # another process may compile it, too
    digest = f'-DRADARSIM_SOURCES="{source_digest()}"'
    source = str(FOLDER / "engine.cpp")
    arguments = (*FLAGS.split(), digest, source, "-o", str(new), "-lm", "-lpthread")
    with tempfile.TemporaryDirectory() as cache:  # else 40 MB stay in the home
        environment = os.environ | {
            "ZIG_GLOBAL_CACHE_DIR": cache,
            "ZIG_LOCAL_CACHE_DIR": cache,
        }
        done = subprocess.run([*command, *arguments], check=False, env=environment)
    if done.returncode:
        sys.exit(
            f"cannot compile {source}: {command[0]} ended with {done.returncode};"
            " the compiler is that of the package ziglang, of the version in"
            " pyproject.toml"
        )
    new.replace(target)


if __name__ == "__main__":  # another compiler can be given, for example for sanitizers
    compile_engine(LIBRARY, *sys.argv[1:])
