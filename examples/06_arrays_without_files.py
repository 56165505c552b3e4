"""No files: arrays in, arrays out. A frame is uint8 colour, float32 depth in metres (0 = missing, inf = sky), and a camera."""

import numpy as np

import dlama

camera = dlama.Camera.from_fov(160, 120, fov=60)
depth = np.full(camera.hw, 4.0, np.float32)  # a wall
depth[40:80, 60:100] = 2.0  # a box before it
depth[:20] = np.inf  # sky above
color = np.full((*camera.hw, 3), (150, 140, 130), np.uint8)
color[40:80, 60:100] = (200, 60, 40)
color[:20] = (120, 170, 230)
rgbd = dlama.RGBD(color, depth, camera)

cloud = dlama.lift(rgbd)
moved = dlama.orbit(camera, 10)
seen = dlama.render(rgbd, moved)
done = dlama.view(rgbd, moved)

print(f"{len(cloud)} points; at 10 degrees {seen.hole.mean():.1%} of the picture is unknown")
print(f"behind the box the wall was filled at {np.median(done.view.depth[done.view.filled]):.2f} m")
assert not done.view.hole.any()
assert (done.view.color[~seen.hole] == seen.color[~seen.hole]).all()
