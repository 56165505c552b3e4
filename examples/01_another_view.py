"""Another view: a picture, its depth and a move in; the scene from there, with what was hidden filled, out."""

import sys
from pathlib import Path

import dlama

demo = dlama.example()
out = Path(sys.argv[1] if len(sys.argv) > 1 else "out/01_another_view")

rgbd = dlama.read_rgbd(demo / "street.jpg", demo / "depth.png", fov=90)
done = dlama.view(rgbd, yaw=20, pitch=5)  # to the right and up, still looking at the point at the median depth

for kind, share in done.meta["hole_share_by_type"][0].items():
    print(f"{kind:12} {share:6.1%}")
dlama.write(done, out)
