"""Planes of a crop round an object in -> the logit of each pixel lying in the object's shadow out: a small U-Net.

Convolutions with batch norms at a half to a thirty-second of the crop's size, the largest value of each channel over the whole
crop at the coarsest (whether there is such a shadow anywhere), and back up. `shadow_export` writes it as an ONNX file.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn.functional import interpolate, pixel_shuffle

from dlama.errors import ShapeError

WIDTHS = 16, 24, 48, 64, 64
"""Channels at each size."""
SHADOW_MULTIPLE = 2 ** len(WIDTHS)
"""What height and width of the crop are multiples of."""
RARE = -2.0
"""Logit of a pixel that nothing is known of."""


class Block(nn.Sequential):
    """A convolution, a batch norm and ReLU."""

    def __init__(self, channels: int, out: int, kernel: int = 3, stride: int = 1) -> None:
        layer = nn.Conv2d(channels, out, kernel, stride, kernel // 2, bias=False)
        super().__init__(layer, nn.BatchNorm2d(out), nn.ReLU())


class ShadowNet(nn.Module):
    """B x planes x H x W -> B x H x W logits; H and W multiples of SHADOW_MULTIPLE, or ShapeError.

    deeper: two more convolutions at the coarsest sizes, and a wider first one.
    """

    def __init__(self, planes: int, widths: tuple[int, ...] = WIDTHS, deeper: bool = False) -> None:
        super().__init__()
        one, two, three, four, five = widths
        self.down1 = Block(planes, one, 5 if deeper else 3, stride=2)
        self.down2, self.block2 = Block(one, two, stride=2), Block(two, two)
        self.down3, self.block3 = Block(two, three, stride=2), Block(three, three)
        self.down4, self.down5 = Block(three, four, stride=2), Block(four, five, stride=2)
        self.block4, self.block5 = (Block(four, four), Block(five, five)) if deeper else (nn.Identity(), nn.Identity())
        self.whole = nn.Conv2d(five, five, 1)
        self.own = nn.Conv2d(five, five, 1, bias=False)
        self.join4, self.up4 = Block(five + four, four, 1), Block(four, four)
        self.join3, self.up3 = Block(four + three, three, 1), Block(three, three)
        self.join2, self.up2 = Block(three + two, two, 1), Block(two, two)
        self.join1, self.up1 = Block(two + one, one, 1), Block(one, one)
        self.head = nn.Conv2d(one, 4, 3, padding=1)
        nn.init.constant_(self.head.bias, RARE)  # type: ignore[arg-type]

    def forward(self, planes: Tensor) -> Tensor:
        """As the class says."""
        if any(side % SHADOW_MULTIPLE for side in planes.shape[2:]):
            raise ShapeError(
                f"planes are {tuple(planes.shape)}; height and width are expected as multiples of {SHADOW_MULTIPLE}"
            )
        one = self.down1(planes)
        two = self.block2(self.down2(one))
        three = self.block3(self.down3(two))
        four = self.block4(self.down4(three))
        five = self.block5(self.down5(four))
        h = (self.own(five) + self.whole(five.amax((2, 3), keepdim=True))).relu()
        for join, up, seen in (
            (self.join4, self.up4, four),
            (self.join3, self.up3, three),
            (self.join2, self.up2, two),
            (self.join1, self.up1, one),
        ):
            h = up(join(torch.cat([interpolate(h, scale_factor=2, mode="nearest"), seen], 1)))
        return pixel_shuffle(self.head(h), 2)[:, 0]
