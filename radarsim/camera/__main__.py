"""A process that draws pictures for the server that has started it.

It reads pickles: first a scene and the type of its pictures, then views with the
regions that are wanted of each. It answers each view with the length of a pickle, 8
bytes, and the pickle: the bytes of the pictures by region. It ends when its input does,
so also when the server is killed.
"""

import os
import pickle
import struct
import sys
from contextlib import suppress
from typing import BinaryIO

from radarsim.camera.encoding import encode
from radarsim.camera.renderer import Renderer

NICENESS = 10  # ticks of the server go first


def draw_pictures(requests: BinaryIO, replies: BinaryIO) -> None:
    """Answer requests until there are no more."""
    with suppress(EOFError, BrokenPipeError):
        scene, image_type = pickle.load(requests)
        renderer = Renderer(scene)
        while True:
            view, regions = pickle.load(requests)
            pixels = renderer.render(view)
            pictures = {each: encode(pixels, each, image_type) for each in regions}
            data = pickle.dumps(pictures)
            replies.write(struct.pack(">Q", len(data)) + data)
            replies.flush()


def main() -> None:
    """Draw what is asked for on stdin; the answers go to stdout."""
    replies = sys.stdout.buffer
    sys.stdout = sys.stderr  # nothing else may be written there
    if sys.platform != "win32":
        os.nice(NICENESS)
    draw_pictures(sys.stdin.buffer, replies)


if __name__ == "__main__":
    main()
