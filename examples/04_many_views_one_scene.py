"""Many views: cameras in; one scene out. Each view sees what the earlier ones filled, so all of them agree."""

import sys
from pathlib import Path

import numpy as np

import dlama

demo = dlama.example()
out = Path(sys.argv[1] if len(sys.argv) > 1 else "out/04_many_views_one_scene")

rgbd = dlama.read_rgbd(demo / "street.jpg", demo / "depth.png", fov=90)
cameras = [dlama.orbit(rgbd, yaw) for yaw in (-10, 10, 20)]
done = dlama.complete(rgbd, cameras)

for camera, view in zip(cameras, done.views):
    again = dlama.render(done.scene, camera)
    both = view.valid & again.valid
    off = np.abs(again.depth[both] - view.depth[both]) / view.depth[both]
    print(f"rendered again from the scene: depth within 1 % at {(off < 0.01).mean():.1%} of the pixels")
dlama.write(done, out)
