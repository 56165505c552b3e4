"""Stereo: two pictures and their calibration in; depth, and both pictures without an object, out. Both views agree."""

import sys
from pathlib import Path

import dlama

demo = dlama.example()
out = Path(sys.argv[1] if len(sys.argv) > 1 else "out/03_stereo_pair")

left, right = dlama.read_color(demo / "street.jpg"), dlama.read_color(demo / "right.jpg")
rig = dlama.read_stereo_calib(demo / "calib.txt")
done = dlama.stereo(left, right, rig, mask=dlama.read_mask(demo / "mask.png"))

print(f"baseline {rig.baseline_m} m, largest disparity {done.disparity_left.max():.1f} px")
print(f"left and right agree within 1 px at {done.agreement.left_right_within_1px:.1%} of the pixels")
dlama.write(done, out)
