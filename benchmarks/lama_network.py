"""big-lama's geometry with random weights at one size -> a table of seconds: eager torch, frozen TorchScript, ONNX Runtime,
OpenVINO where it is installed; and with --where, what ONNX Runtime spends its time on, by operator.

    python benchmarks/lama_network.py [--size 512] [--runs 5] [--threads 2] [--where] [--skip-openvino]

One run, engines interleaved, so that the ratios hold on a machine that others use too. The roofline is the time this
machine's fastest matrix product (torch, 2048 x 2048) needs for the network's multiplications. Needs torch and onnx.
"""

from __future__ import annotations

import argparse
import importlib.util
import json
import os
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from statistics import median

import numpy as np
import onnxruntime
import torch

from dlama.inpainters.networks.contract import generator_contract
from dlama.models.openvino import OpenVinoSession
from dlama.nets.architecture import GeneratorSettings, generator_shapes
from dlama.nets.export.generator import onnx_bytes
from dlama.nets.generator import generator_from_state


def random_state(settings: GeneratorSettings) -> dict[str, np.ndarray]:
    """Weights that keep the activations' size, so that no engine meets denormals or infinities."""
    rng = np.random.default_rng(0)
    state = {}
    for name, shape in generator_shapes(settings).items():
        if len(shape) == 4:
            state[name] = rng.normal(0, np.prod(shape[1:]) ** -0.5, shape).astype(np.float32)
        elif name.endswith(".conv2.bn_l.weight") or name.endswith(".conv2.bn_g.weight"):
            state[name] = np.full(
                shape, 0.1, np.float32
            )  # 18 blocks at full strength would amplify rounding 1000 times
        elif name.endswith(("running_var", "weight")):
            state[name] = rng.uniform(0.5, 1.5, shape).astype(np.float32)
        else:
            state[name] = rng.normal(0, 0.1, shape).astype(np.float32 if shape else np.int64)
    return state


def operations(settings: GeneratorSettings, size: int) -> float:
    """Multiplications and additions of the convolutions; the Fourier transforms are not counted, however they are done."""
    total, low = 0.0, size // settings.multiple
    first, last = 2 + settings.downsamplings, settings.concat_index
    for name, shape in generator_shapes(settings).items():
        if len(shape) != 4:
            continue
        index = int(name.split(".")[1])
        halvings = max(index - 1, 0) if index < first else settings.downsamplings if index < last + 2 else (
            settings.downsamplings - (index - last - 1) // 3)  # fmt: skip
        columns = low // 2 + 1 if "conv_layer" in name else size >> halvings
        total += 2.0 * np.prod(shape) * (size >> halvings) * columns
    return total


def product_rate(clock: Callable[[], float]) -> float:
    """Operations per second of a large float32 matrix product."""
    a = torch.rand(2048, 2048)
    start = clock()
    for _ in range(3):
        a @ a
    return 3 * 2 * 2048**3 / (clock() - start)


def engines(
    settings: GeneratorSettings, size: int, threads: int, with_openvino: bool
) -> dict[str, Callable[[], np.ndarray]]:
    """Name -> a call that runs the same picture through the same weights."""
    state = random_state(settings)
    planes = np.random.default_rng(1).random((1, settings.in_channels, size, size), dtype=np.float32)
    tensor, net = torch.from_numpy(planes), generator_from_state(state)
    script = torch.jit.freeze(torch.jit.trace(net, tensor, check_trace=False))
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = threads
    model = onnx_bytes(settings, state, generator_contract(settings).metadata())
    session = onnxruntime.InferenceSession(model, options, providers=["CPUExecutionProvider"])
    calls = {
        "eager torch": lambda: net(tensor).numpy(),
        "frozen TorchScript": lambda: script(tensor).numpy(),
        "ONNX Runtime": lambda: session.run(None, {"planes": planes})[0],
    }
    if with_openvino and importlib.util.find_spec("openvino"):
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "random.onnx"
            path.write_bytes(model)
            vino = OpenVinoSession(path, threads)
        calls["OpenVINO"] = lambda: vino.run(None, {"planes": planes})[0]
    return calls


def where(settings: GeneratorSettings, size: int, threads: int) -> None:
    """Print the share of each operator in one run of ONNX Runtime, by its own profiler."""
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads, options.enable_profiling = threads, True
    with tempfile.TemporaryDirectory() as folder:
        options.profile_file_prefix = str(Path(folder) / "profile")
        model = onnx_bytes(settings, random_state(settings), generator_contract(settings).metadata())
        session = onnxruntime.InferenceSession(model, options, providers=["CPUExecutionProvider"])
        planes = np.random.default_rng(1).random((1, settings.in_channels, size, size), dtype=np.float32)
        for _ in range(3):
            session.run(None, {"planes": planes})
        events = json.loads(Path(session.end_profiling()).read_text())
    took: Counter[str] = Counter()
    for event in events:
        if event.get("cat") == "Node" and event["name"].endswith("_kernel_time"):
            took[event["args"]["op_name"]] += event["dur"]
    for name, micros in took.most_common(8):
        print(f"{name:24} {micros / sum(took.values()):6.1%}")


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--size", type=int, default=512)
    parser.add_argument("--runs", type=int, default=5)
    parser.add_argument("--threads", type=int, default=os.cpu_count())
    parser.add_argument("--where", action="store_true")
    parser.add_argument("--skip-openvino", action="store_true", help="its waiting threads slow the others down")
    arguments = parser.parse_args()
    if arguments.where:
        where(GeneratorSettings(), arguments.size, arguments.threads)
        return
    torch.set_num_threads(arguments.threads)
    settings = GeneratorSettings()
    with torch.inference_mode():
        calls = engines(settings, arguments.size, arguments.threads, not arguments.skip_openvino)
        outputs = {name: call() for name, call in calls.items()}  # also the warm-up; TorchScript wants a second
        calls["frozen TorchScript"]()
        seconds: dict[str, list[float]] = {name: [] for name in calls}
        clock = time.process_time if arguments.threads == 1 else time.perf_counter  # alone, CPU time ignores neighbours
        rates = []
        for _ in range(arguments.runs):
            rates.append(product_rate(clock))
            for name, call in calls.items():
                time.sleep(0.3)  # lets the other engine's threads stop spinning
                start = clock()
                call()
                seconds[name].append(clock() - start)
    work = operations(settings, arguments.size)
    roof = work / max(rates)
    print(f"big-lama at {arguments.size}x{arguments.size}, {arguments.threads} threads: {work / 1e9:.0f} GFLOP, "
          f"roofline {roof:.2f} s (products at {max(rates) / 1e9:.0f} GFLOP/s)")  # fmt: skip
    print(
        f"{'engine':20} {'best s':>8} {'median s':>9} {'x roofline':>11} {'vs TorchScript':>15} {'max |difference|':>17}"
    )
    for name, times in seconds.items():
        faster = min(seconds["frozen TorchScript"]) / min(times)
        apart = np.abs(outputs[name] - outputs["eager torch"]).max()
        print(
            f"{name:20} {min(times):8.2f} {median(times):9.2f} {min(times) / roof:11.2f} {faster:15.2f} {apart:17.1e}"
        )


if __name__ == "__main__":
    main()
