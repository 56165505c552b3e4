"""Every verb's examples: what `dlama VERB --help` shows below its first line."""

from __future__ import annotations

EXAMPLES: dict[str, tuple[str, ...]] = {
    "view": (
        "dlama view photo.jpg depth.png --fov 65 --yaw 20 -o out",
        "dlama view photo.jpg --yaw 8 --metres-at 320,400=2.5 --also scene -o out",
        "dlama view photo.jpg depth.exr --camera cam.json --yaw -10 --pitch 5 -o out",
        "dlama view photo.jpg depth.png --camera cam.json --to target.json --only image,depth -o out",
    ),
    "remove": (
        "dlama remove photo.jpg depth.png --click 150,250 --with-shadow --fov 65 -o out",
        "dlama remove photo.jpg depth.png mask.png --fov 65 -o out",
        "dlama remove photo.jpg depth.png mask.png --fov 65 --yaw 20 -o out",
        "dlama remove photo.jpg mask.png -o out",
        "dlama remove color.jpeg depth.exr semantic.png --mask-class barrel --fov 90 --depth-range 10 -o out",
    ),
    "mask": (
        "dlama mask photo.jpg depth.png --fov 65 --click 150,250 -o mask.png",
        "dlama mask photo.jpg --box 120,90,60,200 -o mask.png",
        "dlama mask photo.jpg depth.png --fov 65 --click 150,250 --not 200,310 -o mask.png",
        "dlama mask photo.jpg --click 150,250 --masker segment-anything --mask-model mobile-sam -o mask.png",
    ),
    "stereo": (
        "dlama stereo left.png right.png --calib calib.txt -o out",
        "dlama stereo left.png right.png --calib calib.json --mask left_mask.png -o out",
        "dlama stereo left.png right.png --calib calib.txt --click 150,250 --with-shadow -o out",
    ),
    "photo3d": (
        "dlama photo3d photo.jpg -o out",
        "dlama photo3d photo.jpg depth.png --fov 65 --also splats,stereo,loop -o out",
        "dlama photo3d removed/scene.npz --angle 4 -o out",
    ),
    "sequence": (
        "dlama sequence room -o out",
        "dlama sequence room --frames 0:480:10 --mask frame-000030=mask.png -o out",
        "dlama sequence room --views orbit -o out",
    ),
    "video": (
        "dlama video out/scene.npz --path spiral --seconds 6 -o out.mp4",
        "dlama video room --frames ::5 --path orbit --width 640 -o orbit.webp",
    ),
    "depth": (
        "dlama depth photo.jpg -o out",
        "dlama depth photo.jpg --fov 65 --metres-at 320,400=2.5 100,90=7 -o out",
        "dlama depth photo.jpg --depth-model moge-small -o out",
    ),
    "batch": (
        "dlama batch jobs.csv -o out",
        "dlama batch jobs.jsonl --fov 65 --only image,depth --workers 4 -o out",
        "dlama batch --images 'rgb/*.png' --depths 'depth/{stem}.png' --verb view --yaw 10 --fov 65 -o out",
        "dlama batch jobs.csv --dry-run -o out",
        "dlama batch report out",
    ),
    "doctor": (
        "dlama doctor photo.jpg depth.png --fov 65",
        "dlama doctor photo.jpg depth.png mask.png --camera cam.json",
        "dlama doctor left.png right.png --calib calib.txt",
        "dlama doctor room",
    ),
    "show": (
        "dlama show out",
        "dlama show out/scene.ply --max-points 1000000",
        "dlama show room -o room.html --no-open-browser",
    ),
    "models": (
        "dlama models list",
        "dlama models pull big-lama",
        "dlama models convert big-lama.pt -o big-lama.onnx",
    ),
    "evaluate": (
        "dlama evaluate worlds -o dlama-report",
        "dlama evaluate street --protocol vpi --fillers layered telea migan --model migan=migan.onnx --jobs 2 -o out",
        "dlama evaluate room --layout tum --camera cam.json --limit 20 --no-variants -o out",
    ),
    "worlds": (
        "dlama worlds",
        "dlama worlds --count 8 --kind street --seed 1 -o worlds",
    ),
    "train": (
        "dlama train presets",
        "dlama train tiny -o run",
        "dlama train small-rgbd --data photos/ rooms/ --mixture world=0.5 frame=0.5 --max-minutes 40 -o run",
        "dlama train small-rgbd --resume -o run",
        "dlama train my-settings.json --start big-lama.ckpt --data photos/ rooms/ -o run",
    ),
    "demo": (
        "dlama demo",
        "dlama demo -o /tmp/demo",
    ),
    "serve": (
        "dlama serve",
        "dlama serve --port 8000",
        "dlama serve --host 0.0.0.0 --token SECRET",
    ),
    "version": ("dlama version",),
    "warm-up": ("dlama warm-up",),
}
"""What `dlama VERB --help` shows below its first line."""
