"""Draw all figures of the thesis, with their captions in ``index.md``.

python examples/thesis/draw_all.py [OUT]
"""

import sys
from pathlib import Path

import bugs
import bushes
import dust
import mapped
import noise
import scatter
import side_rays

import maps

out = Path(sys.argv[1] if len(sys.argv) > 1 else "figures")
out.mkdir(parents=True, exist_ok=True)
captions = {}
for script in (maps, dust, scatter, bushes, noise, side_rays, bugs, mapped):
    for name, (figure, caption) in script.draw().items():
        figure.savefig(out / name)
        captions[name] = caption
        print(f"{name}: {caption}")
texts = [f"![]({name})\n\n{captions[name]}\n" for name in sorted(captions)]
(out / "index.md").write_text("\n".join(texts), encoding="utf-8")
