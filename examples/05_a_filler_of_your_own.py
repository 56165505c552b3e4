"""A filler is a function: a view with holes in, colour and depth out. What was measured stays, and the law is kept.

Of a network that fills pictures `dlama.Painter` makes a filler.
"""

import sys
from pathlib import Path

import numpy as np

import dlama

demo = dlama.example()
out = Path(sys.argv[1] if len(sys.argv) > 1 else "out/05_a_filler_of_your_own")


def flat(view, context, seed):
    """One colour, at the median depth; whatever lies in front of something measured is moved behind it afterwards."""
    color = np.full_like(view.color, np.median(view.color[~view.hole], axis=0).astype(np.uint8))
    return dlama.Fill(color, np.full_like(view.depth, np.median(view.depth[view.valid])))


def mean_color(picture, hole, seed):
    """Any network that fills pictures goes here: uint8 H x W x 3 and a mask in, the picture out. Depth is dlama's."""
    painted = picture.copy()
    painted[hole] = picture[~hole].mean(axis=0)
    return painted


rgbd = dlama.read_rgbd(demo / "street.jpg", demo / "depth.png", fov=90)
done = dlama.view(rgbd, yaw=20, filler=flat)
print(
    f"filled {done.meta['filled_pixels']} pixels, {done.meta['law_moves']} of them had to move behind what was measured"
)
dlama.write(done, out)

painted = dlama.view(rgbd, yaw=20, filler=dlama.Painter(mean_color))
print(f"{painted.meta['filler']} painted, depth is of {painted.meta['notes']['planes']} surfaces")
dlama.write(painted, out / "painted", only=["image", "depth"])
