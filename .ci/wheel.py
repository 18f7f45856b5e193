"""Compares a wheel with the checkout that it was built from: nothing may be missing."""

import sys
import zipfile
from pathlib import Path

wheel, checkout = Path(sys.argv[1]), Path(sys.argv[2])
held = set(zipfile.ZipFile(wheel).namelist())
wanted = {"radarsim/py.typed"}
for folder, home in (("radarsim", ""), ("maps", "radarsim/")):
    files = (path for path in (checkout / folder).rglob("*") if path.is_file())
    for path in files:
        if "__pycache__" not in path.parts and path.suffix not in {".cpp", ".hpp"}:
            wanted.add(home + path.relative_to(checkout).as_posix())
missing = sorted(wanted - held)
if missing:
    sys.exit(f"not in {wheel.name}: {missing}")
licences = {Path(name).name for name in held if ".dist-info/licenses/" in name}
if licences != {"LICENSE", "three.LICENSE"}:
    sys.exit(f"licences in the metadata of {wheel.name}: {sorted(licences)}")
strangers = sorted(n for n in held if not n.startswith(("radarsim/", "radarsim-")))
if strangers:
    sys.exit(f"only the package belongs into {wheel.name}: {strangers}")
if not wheel.name.endswith("-py3-none-manylinux_2_17_x86_64.whl"):
    sys.exit(f"{wheel.name} has another tag than the platform of its engine")
sys.stdout.write(f"{wheel.name}: {len(held)} files, {wheel.stat().st_size} bytes\n")
