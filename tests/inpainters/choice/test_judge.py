"""The judge: what runs without torch against its twin in torch; laws of sets; what is refused."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import onnx
import pytest

from dlama.errors import FileError, ShapeError
from dlama.inpainters.choice.judge import MARGIN, hole_box, judge_metadata, open_judge, run_judge
from dlama.inpainters.choice.mixing import choose_depth, enlarge_maps, mix_colors, softmax
from dlama.inpainters.choice.planes import CONTEXT, GUESS, JudgePlanes, stack_small
from dlama.models.network_file import NetworkFile
from dlama.nets.architecture import JudgeSettings, judge_shapes
from dlama.nets.export.judge import export_judge

torch = pytest.importorskip("torch")

from dlama.nets.judge import GuessMixer, Judge  # noqa: E402


def random_judge(seed: int = 0) -> Judge:
    """A judge whose every layer does something; its numbers fit half precision, as those in files do."""
    torch.manual_seed(seed)
    judge = Judge(JudgeSettings(width=8)).eval()
    for name, tensor in judge.named_parameters():
        scale = 0.5 / tensor[0].numel() ** 0.5 if tensor.ndim > 1 else 0.1
        tensor.data = (scale * torch.randn(tensor.shape)).half().float()
        if name == "head.weight":
            tensor.data *= 8
    return judge


def file_of(judge: Judge, folder: Path) -> NetworkFile:
    """Its ONNX file."""
    weights = folder / "judge.safetensors"
    weights.write_bytes(b"")
    state = {name: tensor.numpy() for name, tensor in judge.state_dict().items()}
    return open_judge(export_judge(judge.settings, state, folder / "judge.onnx", judge_metadata(weights, "none")))


def random_planes(count: int, height: int, width: int, seed: int = 0) -> JudgePlanes:
    rng = np.random.default_rng(seed)
    context = rng.random((len(CONTEXT), height, width), np.float32)
    context[-1] = context[-1] > 0.5
    return JudgePlanes(context, rng.random((count, len(GUESS), height, width), np.float32))


@pytest.mark.parametrize(("count", "height", "width"), [(1, 16, 16), (4, 48, 80), (7, 64, 32)])
def test_the_file_gives_what_torch_gives(count, height, width, tmp_path):
    """Oracle: the twin in torch, for any number of guesses and any size."""
    judge, planes = random_judge(), random_planes(count, height, width)
    found = run_judge(file_of(judge, tmp_path), planes)
    with torch.no_grad():
        logits, errors = judge(torch.from_numpy(planes.context)[None], torch.from_numpy(planes.guesses)[None])
    assert np.ptp(logits.numpy()) > 0.1
    for number, mine in enumerate((found.base, found.detail, found.depth)):
        np.testing.assert_allclose(mine, logits[0, :, number].numpy(), atol=2e-4)
    np.testing.assert_allclose(np.log(found.color_error), errors[0, 0].numpy(), atol=2e-4)


def test_the_mixture_is_that_of_training(tmp_path):
    """Oracle: the twin in torch, colours and the chosen guess."""
    judge, planes = random_judge(), random_planes(3, 32, 48)
    colors = [np.round(one[:3].transpose(1, 2, 0) * 255).astype(np.uint8) for one in planes.guesses]
    planes.guesses[:, :3] = np.stack(colors).transpose(0, 3, 1, 2) / np.float32(255)
    verdict = run_judge(file_of(judge, tmp_path), planes)
    mine = mix_colors(colors, planes.guesses[:, :3], verdict.base, verdict.detail, (32, 48))
    mixer = GuessMixer(judge.settings, 3).eval()
    mixer.judge = judge
    context = planes.context
    flat = np.concatenate([context[:4], context[-1:], context[4:-1], planes.guesses.reshape(-1, 32, 48)])
    with torch.no_grad():
        theirs = mixer(torch.from_numpy(flat)[None])[0].numpy()
    np.testing.assert_allclose(mine / 255, theirs[:3].transpose(1, 2, 0), atol=0.51 / 255 + 1e-4)
    weights = softmax(enlarge_maps(verdict.depth))
    np.testing.assert_allclose(weights, theirs[6:], atol=1e-4)


def test_the_order_of_guesses_does_not_matter(tmp_path):
    """Law of sets: the verdict on each guess goes with it, the errors stay."""
    network, planes, order = file_of(random_judge(), tmp_path), random_planes(4, 32, 32), [2, 0, 3, 1]
    one = run_judge(network, planes)
    other = run_judge(network, JudgePlanes(planes.context, planes.guesses[order]))
    for name in ("base", "detail", "depth"):
        np.testing.assert_allclose(getattr(other, name), getattr(one, name)[order], atol=1e-5)
    np.testing.assert_allclose(other.depth_error, one.depth_error, atol=1e-5)


def test_a_single_guess_comes_back(tmp_path):
    """Law: weights add up to 1, so one guess is the answer, bit for bit."""
    planes = random_planes(1, 32, 48)
    color = np.round(planes.guesses[0, :3].transpose(1, 2, 0) * 255).astype(np.uint8)
    verdict = run_judge(file_of(random_judge(), tmp_path), planes)
    mixed = mix_colors([color], planes.guesses[:, :3], verdict.base, verdict.detail, (32, 48))
    np.testing.assert_array_equal(mixed, color)
    hole = np.ones((32, 48), bool)
    assert not choose_depth(verdict.depth, [planes.guesses[0, 3]], hole, (32, 48)).any()


def test_equal_depths_vote_together():
    """Closed form: two guesses of 0.3 each with one depth beat one of 0.4; the first of them is named."""
    same, other = np.ones((16, 16), np.float32), np.zeros((16, 16), np.float32)
    logits = np.log(np.float32([0.4, 0.3, 0.3]))[:, None, None] * np.ones((3, 4, 4), np.float32)
    hole = np.ones((16, 16), bool)
    assert (choose_depth(logits, [other, same, same.copy()], hole, (16, 16)) == 1).all()
    assert (choose_depth(logits, [other, same, same + 1], hole, (16, 16)) == 0).all()


def test_another_depth_is_taken_only_where_it_is_sure():
    """Closed form: the left third trusts the second guess by 0.995, the middle by 0.6, the rest the first by 0.9."""
    weights = np.full((2, 16, 48), 0.5, np.float32)
    for columns, share in ((np.s_[:16], 0.995), (np.s_[16:32], 0.6), (np.s_[32:], 0.1)):
        weights[:, :, columns] = np.array([1 - share, share], np.float32)[:, None, None]
    hole, depths = np.ones((64, 192), bool), [np.zeros((64, 192), np.float32), np.ones((64, 192), np.float32)]
    weights[0, 8:, 16:] = 0.95
    weights[1, 8:, 16:] = 0.05
    found = choose_depth(np.log(weights), depths, hole, (64, 192))
    assert (found[:, :40] == 1).all() and (found[:, 90:] == 0).all()


def test_large_views_are_judged_smaller():
    """Closed form: a constant stays what it is at the smaller size, and sides are multiples after padding."""
    quarters = [np.full((900, 1300), 0.25, np.float32)]
    small = JudgePlanes(stack_small(quarters * len(CONTEXT)), np.stack([stack_small(quarters * len(GUESS))] * 2))
    assert small.context.shape == (len(CONTEXT), 443, 640) and small.guesses.shape == (2, 4, 443, 640)
    np.testing.assert_allclose(small.context, 0.25, atol=1e-6)
    assert small.pad().context.shape[1:] == (448, 640)


def test_shapes_are_those_of_the_network():
    """Oracle: torch's own tensors, against the table that needs no torch."""
    for width in (8, 24):
        settings = JudgeSettings(width=width)
        assert {name: tuple(one.shape) for name, one in Judge(settings).state_dict().items()} == judge_shapes(settings)


def test_the_judge_sees_the_hole_and_what_is_round_it(tmp_path):
    """Oracle: the verdict on the crop alone, in its place; 0 elsewhere. Closed form: the box, in steps of 16 pixels."""
    planes = random_planes(3, 320, 480)
    planes.context[-1] = 0
    planes.context[-1, 10:20, 250:260] = 1
    rows, columns = hole_box(planes.context[-1] > 0)
    assert (rows, columns) == (slice(0, 128), slice((250 - MARGIN) // 16 * 16, 368))
    file = file_of(random_judge(), tmp_path)
    found = run_judge(file, planes)
    crop = run_judge(file, JudgePlanes(planes.context[:, rows, columns], planes.guesses[:, :, rows, columns]))
    place = np.s_[..., :32, columns.start // 4 : 92]
    for name, whole in vars(found).items():
        np.testing.assert_allclose(whole[place], vars(crop)[name], atol=1e-5)
        rest = whole.copy()
        rest[place] = 0
        assert not rest.any()
    assert hole_box(np.zeros((32, 48), bool)) == (slice(0, 32), slice(0, 48))


def test_files_that_are_no_judge_are_refused(tmp_path):
    """Oracle: the messages; another network's file, and a judge of other planes."""
    file = file_of(random_judge(), tmp_path).path
    model = onnx.load(file)
    about = json.loads(model.metadata_props[0].value)
    for changed, match in (({"network": "lama"}, "no judge"), ({"context": ["red"]}, "another version")):
        model.metadata_props[0].value = json.dumps(about | changed)
        other = tmp_path / f"{match.replace(' ', '-')}.onnx"
        onnx.save(model, other)
        with pytest.raises(FileError, match=match):
            open_judge(other)
    with pytest.raises(ShapeError, match="multiples of 16"):
        random_judge()(torch.zeros(1, 10, 20, 16), torch.zeros(1, 2, 4, 20, 16))
