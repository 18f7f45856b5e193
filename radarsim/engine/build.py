"""Compile the engine with the compiler from the PyPI package ``ziglang``.

``hatch_build.py`` compiles the engine when the package is built or installed. In a
checkout run ``python radarsim/engine/build.py [COMPILER]``. This file does not import
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
    # Products and sums are not fused, so all processors compute the same bits.
    " -ffp-contract=off"
    # Square roots do not set errno, so loops with square roots can be vectorised.
    " -fno-math-errno"
)
# "zig cc" also compiles C++; "zig c++" would first build its standard library. The
# version of glibc is that of manylinux_2_17.
ZIG: Final = (
    *("-m", "ziglang", "cc", "-s", "-target", "x86_64-linux-gnu.2.17"),
    # A ray passes through a dozen functions; inlining them saves a tenth of the time.
    *("-mllvm", "-inline-threshold=4000", "-fomit-frame-pointer"),
    # Reading coordinates in pairs is slow just after they were written one by one.
    "-fno-slp-vectorize",
)


def source_digest() -> str:
    """Return a digest of the engine's source files, which must exist."""
    digest = hashlib.sha256(" ".join((FLAGS, *ZIG)).encode())
    for path in sorted(FOLDER.glob("*.[ch]pp")):
        digest.update(path.name.encode() + path.read_bytes())
    return digest.hexdigest()[:16]


def compile_engine(target: Path = LIBRARY, *compiler: str) -> None:
    """Compile the engine.

    Args:
        target: The library to be written; it is replaced when the new one is complete.
        compiler: Compiler command with its options; by default ``zig cc``.

    Raises:
        SystemExit: If the compiler is missing or reports an error.
    """
    if platform.machine() != "x86_64" or sys.platform != "linux":
        sys.exit(
            "radarsim runs on Linux on x86-64, for which embreex and this package are"
            f" tested, not on {sys.platform} on {platform.machine()}"
        )
    command = compiler or (sys.executable, *ZIG, "-mcpu=x86_64_v2")
    new = target.with_suffix(f".{os.getpid()}")  # other processes may also compile
    digest = f'-DRADARSIM_SOURCES="{source_digest()}"'
    source = str(FOLDER / "engine.cpp")
    arguments = (*FLAGS.split(), digest, source, "-o", str(new), "-lm", "-lpthread")
    with tempfile.TemporaryDirectory() as cache:  # 40 MB, by default in the home folder
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


if __name__ == "__main__":  # arguments are another compiler, such as for sanitizers
    compile_engine(LIBRARY, *sys.argv[1:])
