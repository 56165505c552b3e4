"""Guesses at a picture and what is known of it in -> how far each guess is trusted, and the expected error, out: the judge.

A guess goes through the same layers as every other; they meet in means and maxima over guesses alone. So their order does not
matter, and there may be any number of them. Everything runs at a quarter of the picture's size; weights are enlarged smoothly.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn.functional import avg_pool2d, conv2d, interpolate, pad

from dlama.errors import ShapeError
from dlama.nets.architecture import (
    JUDGE_APART,
    JUDGE_ERRORS,
    JUDGE_HEADS,
    JUDGE_LOG_BOUNDS,
    JUDGE_MULTIPLE,
    JUDGE_STRIDE,
    JudgeSettings,
)

BASE_KERNEL = (0.054489, 0.244201, 0.402620, 0.244201, 0.054489)
"""A Gaussian of sigma 1 over means of squares of JUDGE_STRIDE pixels: what it leaves of a guess is its base, the rest detail."""


class Residual(nn.Module):
    """x + conv(relu(conv(relu(x)))), the second convolution zero at first."""

    def __init__(self, channels: int, dilation: int = 1) -> None:
        super().__init__()
        self.first = nn.Conv2d(channels, channels, 3, padding=dilation, dilation=dilation)
        self.second = nn.Conv2d(channels, channels, 3, padding=1)
        nn.init.zeros_(self.second.weight)

    def forward(self, x: Tensor) -> Tensor:
        """B x C x H x W -> the same shape."""
        return x + self.second(self.first(x.relu()).relu())


class Join(nn.Module):
    """Each guess with what all guesses share: one convolution of its own channels plus one of the shared ones."""

    def __init__(self, own: int, shared: int, out: int) -> None:
        super().__init__()
        self.own, self.shared = nn.Conv2d(own, out, 1), nn.Conv2d(shared, out, 1, bias=False)

    def forward(self, own: Tensor, shared: Tensor) -> Tensor:
        """B x K x own x h x w and B x shared x h x w -> B x K x out x h x w."""
        return apply_to_each(self.own, own) + self.shared(shared)[:, None]


class Trunk(nn.Module):
    """Shared channels at three sizes, for context; a small U-Net."""

    def __init__(self, channels: int, width: int) -> None:
        super().__init__()
        half, quarter = 3 * width // 2, 2 * width
        self.enter = nn.Conv2d(channels, width, 1)
        self.down1 = nn.Conv2d(width, half, 3, stride=2, padding=1)
        self.block1 = Residual(half)
        self.down2 = nn.Conv2d(half, quarter, 3, stride=2, padding=1)
        self.block2, self.block3 = Residual(quarter, 2), Residual(quarter, 4)
        self.up1, self.blend1 = nn.Conv2d(quarter, half, 1), Residual(half)
        self.up2, self.blend2 = nn.Conv2d(half, width, 1), Residual(width)

    def forward(self, x: Tensor) -> Tensor:
        """B x channels x h x w -> B x width x h x w."""
        fine = self.enter(x)
        middle = self.block1(self.down1(fine.relu()))
        coarse = self.block3(self.block2(self.down2(middle.relu())))
        middle = self.blend1(middle + double_size(self.up1(coarse.relu())))
        return self.blend2(fine + double_size(self.up2(middle.relu())))


class Judge(nn.Module):
    """Context B x C x H x W and guesses B x K x 4 x H x W -> logits B x K x 3 x h x w and log errors B x 2 x h x w, h = H / 4."""

    def __init__(self, settings: JudgeSettings | None = None) -> None:
        super().__init__()
        self.settings = s = settings or JudgeSettings()
        w, t = s.width, 2 * s.width
        self.of_context = nn.Conv2d(s.context_planes, w, JUDGE_STRIDE, stride=JUDGE_STRIDE)
        self.of_guess = nn.Conv2d(2 * s.guess_planes, w, JUDGE_STRIDE, stride=JUDGE_STRIDE, bias=False)
        self.block1, self.join1 = Residual(w), Join(w, 2 * w, w)
        self.trunk = Trunk(3 * w, t)
        self.join2, self.block2 = Join(w, t, w), Residual(w)
        self.join3 = Join(w, 2 * w, w)
        self.head = nn.Conv2d(w, JUDGE_HEADS, 3, padding=1)
        self.errors = nn.Conv2d(t + 2 * w, JUDGE_ERRORS, 3, padding=1)
        for last in (self.head, self.errors):
            nn.init.zeros_(last.weight)
            nn.init.zeros_(last.bias)  # type: ignore[arg-type]
        nn.init.constant_(self.errors.bias, -2.0)  # type: ignore[arg-type]

    def forward(self, context: Tensor, guesses: Tensor) -> tuple[Tensor, Tensor]:
        """As the class says. ShapeError for other planes, or sides that are no multiples of JUDGE_MULTIPLE."""
        refuse_planes(self.settings, tuple(context.shape), tuple(guesses.shape))
        apart = guesses - guesses.mean(1, keepdim=True)
        seen = self.of_context(context)
        h = apply_to_each(self.of_guess, torch.cat([guesses, JUDGE_APART * apart], 2)) + seen[:, None]
        h = apply_to_each(self.block1, h)
        h = self.join1(h.relu(), pool_guesses(h))
        trunk = self.trunk(torch.cat([seen, pool_guesses(h)], 1).relu())
        h = apply_to_each(self.block2, self.join2(h.relu(), trunk.relu()))
        shared = pool_guesses(h)
        h = self.join3(h.relu(), shared)
        logits = apply_to_each(self.head, h.relu())
        errors = self.errors(torch.cat([trunk, shared], 1).relu()).clamp(*JUDGE_LOG_BOUNDS)
        agreeing = torch.cat([logits[:, :, :2], logits[:, :, 1:2] + logits[:, :, 2:]], 2)
        return agreeing, errors


def apply_to_each(layer: nn.Module, x: Tensor) -> Tensor:
    """A layer on each guess: B x K x C x H x W in and out."""
    out = layer(x.flatten(0, 1))
    return out.unflatten(0, x.shape[:2])


def pool_guesses(h: Tensor) -> Tensor:
    """B x K x C x h x w -> B x 2C x h x w: mean and maximum over guesses."""
    return torch.cat([h.mean(1), h.amax(1)], 1)


def double_size(x: Tensor) -> Tensor:
    """Twice the height and width, bilinear."""
    return interpolate(x, scale_factor=2, mode="bilinear", align_corners=False)


def refuse_planes(settings: JudgeSettings, context: tuple[int, ...], guesses: tuple[int, ...]) -> None:
    """Raise ShapeError unless the judge takes planes of these shapes."""
    expected = f"B x {settings.context_planes} x H x W and B x K x {settings.guess_planes} x H x W"
    fits = len(context) == 4 and len(guesses) == 5 and context[1] == settings.context_planes
    if not fits or guesses[2] != settings.guess_planes or context[2:] != guesses[3:] or guesses[1] < 1:
        raise ShapeError(f"judge: planes are {context} and {guesses}, expected {expected}")
    if any(side % JUDGE_MULTIPLE for side in context[2:]):
        raise ShapeError(f"judge: height and width are {context[2:]}, expected multiples of {JUDGE_MULTIPLE}")


class GuessMixer(nn.Module):
    """The judge with the mixture that its weights make: the network that is trained.

    B x P x H x W planes (colour, depth and hole as networks of colour and depth get them, the rest of the context, then the
    guesses) -> B x (6 + K) x H x W: colour, inverse depth (the mean of the guesses while it trains, afterwards the chosen one's),
    both log errors, the weights of depth.
    """

    def __init__(self, settings: JudgeSettings, guesses: int) -> None:
        super().__init__()
        self.judge, self.guesses = Judge(settings), guesses

    def forward(self, planes: Tensor) -> Tensor:
        """See the class."""
        context, guesses = split_planes(planes, self.judge.settings)
        kept = self._kept(planes.device) if self.training else torch.arange(self.guesses)
        logits, errors = self.judge(context, guesses[:, kept])
        weights = smooth_weights(logits[:, :, 1:])
        color = mix_colors(guesses[:, kept, :3], logits[:, :, 0].softmax(1), weights[:, :, 0])
        chosen = weights[:, :, 1] if self.training else one_hot(weights[:, :, 1])
        depth = (chosen * guesses[:, kept, 3]).sum(1, keepdim=True)
        all_weights = torch.zeros_like(guesses[:, :, 0])
        all_weights[:, kept] = weights[:, :, 1].to(all_weights.dtype)
        return torch.cat([color, depth, enlarge(errors), all_weights], 1)

    def _kept(self, device: torch.device) -> Tensor:
        """Numbers of the guesses that this batch has: all of them half the time."""
        if torch.rand(()) < 0.5 or self.guesses < 2:
            return torch.arange(self.guesses, device=device)
        count = int(torch.randint(1, self.guesses, ()))
        return torch.randperm(self.guesses)[: count + 1].to(device)


def split_planes(planes: Tensor, settings: JudgeSettings) -> tuple[Tensor, Tensor]:
    """Context B x C x H x W (the hole last) and guesses B x K x 4 x H x W of the planes that a GuessMixer takes."""
    shared, known = settings.context_planes, settings.guess_planes
    context = torch.cat([planes[:, :known], planes[:, known + 1 : shared], planes[:, known : known + 1]], 1)
    return context, planes[:, shared:].unflatten(1, (-1, settings.guess_planes))


def enlarge(x: Tensor) -> Tensor:
    """JUDGE_STRIDE times the height and width, bilinear."""
    return interpolate(x, scale_factor=JUDGE_STRIDE, mode="bilinear", align_corners=False)


def smooth_weights(logits: Tensor) -> Tensor:
    """B x K x L x h x w logits -> B x K x L x 4h x 4w weights that add up to 1 over guesses."""
    return enlarge(logits.flatten(1, 2)).unflatten(1, logits.shape[1:3]).softmax(1)


def one_hot(weights: Tensor) -> Tensor:
    """B x K x H x W -> 1 for the largest over K, 0 for the others."""
    return torch.zeros_like(weights).scatter_(1, weights.argmax(1, keepdim=True), 1.0)


def mix_colors(colors: Tensor, base: Tensor, detail: Tensor) -> Tensor:
    """Colours B x K x 3 x H x W, weights of bases B x K x h x w and of details B x K x H x W -> B x 3 x H x W in 0..1."""
    with torch.no_grad():
        bases = shrink_to_bases(colors)
        details = colors - enlarge(bases.flatten(0, 1)).unflatten(0, colors.shape[:2])
    mixture = enlarge((base[:, :, None] * bases).sum(1)) + (detail[:, :, None] * details).sum(1)
    return mixture.clamp(0, 1)


def shrink_to_bases(colors: Tensor) -> Tensor:
    """B x K x 3 x H x W -> B x K x 3 x h x w: means of squares of pixels under BASE_KERNEL, borders replicated."""
    small = avg_pool2d(colors.flatten(0, 1), JUDGE_STRIDE)
    kernel, reach = colors.new_tensor(BASE_KERNEL), len(BASE_KERNEL) // 2
    padded = pad(small, (reach,) * 4, mode="replicate").flatten(0, 1)[:, None]
    across = conv2d(conv2d(padded, kernel.view(1, 1, 1, -1)), kernel.view(1, 1, -1, 1))
    return across.view(*colors.shape[:3], *small.shape[2:])
