"""Removal: a mask says what goes; the scene without it, from the same place and from elsewhere, as pictures and clouds."""

import sys
from pathlib import Path

import dlama

demo = dlama.example()
out = Path(sys.argv[1] if len(sys.argv) > 1 else "out/02_remove_an_object")

rgbd = dlama.read_rgbd(demo / "street.jpg", demo / "depth.png", camera=demo / "camera.json")
mask = dlama.read_mask(demo / "mask.png")  # or of an EasySynth picture: read_mask("semantic.png", mask_class="255,0,0")

here = dlama.remove(rgbd, mask)
there = dlama.remove(rgbd, mask, yaw=15)
print(f"everything, and what was filled (c+): {len(here.completed)} points")
print(f"the object hidden, the background restored (c-): {len(here.background)} points")
dlama.write(here, out / "here")
dlama.write(there, out / "there")
