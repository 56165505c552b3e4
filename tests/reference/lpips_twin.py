"""LPIPS (AlexNet, v0.1) in torch, literally as published, on the full-precision weights; and the pictures it is tried on.

`python tests/reference/lpips_twin.py` with DLAMA_DATA set prints the values that test_lpips.py has frozen.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np

LAYERS = ((0, 4, 2, True), (3, 1, 2, True), (6, 1, 1, False), (8, 1, 1, False), (10, 1, 1, False))
"""torchvision's number, stride, padding, and whether a 3 x 3 maximum with stride 2 follows the tap."""
PICTURES = ("noise", "noise on a gradient", "gradients", "box blur", "grey depth", "smallest", "demo removal")


def weights_of(folder: Path) -> dict[str, Any]:
    """The tensors of both files in DLAMA_DATA/weights, float32."""
    import torch

    from dlama.nets.safetensors_file import read_safetensors

    files = [folder / name for name in ("alexnet_features.safetensors", "lpips_alex_lin.safetensors")]
    return {name: torch.tensor(array) for file in files for name, array in read_safetensors(file)[0].items()}


def taps(weights: dict[str, Any], picture: np.ndarray) -> list[Any]:
    """Five unit-normalised feature planes of a uint8 picture, H x W x 3 or H x W."""
    import torch
    from torch.nn import functional as f

    colour = picture if picture.ndim == 3 else np.stack([picture] * 3, axis=2)
    x = torch.tensor(colour.astype(np.float32) / 127.5 - 1).permute(2, 0, 1)[None]
    x = (x - torch.tensor([-0.030, -0.088, -0.188])[:, None, None]) / torch.tensor([0.458, 0.448, 0.450])[:, None, None]
    out = []
    for number, stride, padding, pool in LAYERS:
        kernel, bias = weights[f"features.{number}.weight"], weights[f"features.{number}.bias"]
        x = f.relu(f.conv2d(x, kernel, bias, stride, padding))
        out.append(x / (torch.sqrt((x**2).sum(1, keepdim=True)) + 1e-10))
        x = f.max_pool2d(x, 3, 2) if pool else x
    return out


def lpips(weights: dict[str, Any], a: np.ndarray, b: np.ndarray) -> tuple[float, np.ndarray]:
    """The distance, and its spatial map H x W (`spatial=True` of the published code)."""
    import torch
    from torch.nn import functional as f

    total, spatial = 0.0, torch.zeros(a.shape[:2])
    with torch.no_grad():
        for tap, (p, q) in enumerate(zip(taps(weights, a), taps(weights, b))):
            weighed = f.conv2d((p - q) ** 2, weights[f"lin{tap}.weight"])
            total += float(weighed.mean())
            spatial += f.interpolate(weighed, size=a.shape[:2], mode="bilinear", align_corners=False)[0, 0]
    return total, spatial.numpy()


def pair(name: str) -> tuple[np.ndarray, np.ndarray]:
    """Two pictures by a name of PICTURES; the same on every machine (the last up to its JPEG decoder)."""
    if name == "noise":
        return noise((64, 64, 3), 1), noise((64, 64, 3), 2)
    if name == "noise on a gradient":
        smooth = gradient(512, 512)
        return smooth, np.clip(smooth + noise((512, 512, 3), 3) / 4.0 - 32, 0, 255).astype(np.uint8)
    if name == "gradients":
        return gradient(97, 131), gradient(97, 131)[::-1, ::-1]
    if name == "box blur":
        sharp = noise((77, 120, 3), 4) // 2 + gradient(77, 120) // 2
        return sharp, blurred(sharp)
    if name == "grey depth":
        step = np.where(np.arange(200) < 90, 60, 200) * np.ones((75, 1), int)
        return step.astype(np.uint8), blurred(np.roll(step, 7, axis=1).astype(np.uint8))
    if name == "smallest":
        return noise((31, 31, 3), 5), gradient(31, 31)
    from PIL import Image

    demo = Path(__file__).parents[2] / "src" / "dlama" / "assets" / "demo"
    return np.asarray(Image.open(demo / "street.jpg")), np.asarray(Image.open(demo / "without.jpg"))


def noise(shape: tuple[int, ...], seed: int) -> np.ndarray:
    """uint8, white; a hash of the place (the finaliser of MurmurHash3), so that no library's generator matters."""
    h = np.arange(np.prod(shape), dtype=np.uint64) * 2 + np.uint64(seed * 1_000_003)
    for shift, factor in ((16, 0x85EBCA6B), (13, 0xC2B2AE35)):
        h = ((h ^ (h >> np.uint64(shift))) * np.uint64(factor)) & np.uint64(0xFFFFFFFF)
    return (h >> np.uint64(24)).astype(np.uint8).reshape(shape)


def gradient(height: int, width: int) -> np.ndarray:
    """uint8 H x W x 3: brighter to the right, downwards, and along the diagonal."""
    rows, columns = np.mgrid[:height, :width]
    planes = [columns * 255 // (width - 1), rows * 255 // (height - 1), (rows + columns) * 255 // (height + width - 2)]
    return np.stack(planes, axis=2).astype(np.uint8)


def blurred(picture: np.ndarray) -> np.ndarray:
    """A 5 x 5 box blur, the border repeated, rounded down."""
    grown = np.pad(picture.astype(int), [(2, 2), (2, 2), *[(0, 0)] * (picture.ndim - 2)], mode="edge")
    height, width = picture.shape[:2]
    return (sum(grown[r : r + height, c : c + width] for r in range(5) for c in range(5)) // 25).astype(np.uint8)


if __name__ == "__main__":
    reported = Path(os.environ["DLAMA_DATA"])
    for title in PICTURES:
        print(f'"{title}": {lpips(weights_of(reported / "weights"), *pair(title))[0]:.6f},')
