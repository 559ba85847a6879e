"""Peer of the segmenter's parity test: the same networks by ONNX Runtime.

    onnx_parity.py DIRECTORY     writes NAME.in and NAME.out (f32 or i64, little endian) for each
                                 NAME.onnx that is given, prints shapes and milliseconds as JSON
"""

import json
import sys
import time
from pathlib import Path

import numpy as np
import onnxruntime

REPEATS = 5


def run(path, threads):
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = threads
    session = onnxruntime.InferenceSession(str(path), options, providers=["CPUExecutionProvider"])
    given = session.get_inputs()[0]
    image = np.random.default_rng(0).standard_normal(given.shape).astype("f4")
    times = []
    for _ in range(REPEATS):
        begin = time.perf_counter()
        found = session.run(None, {given.name: image})[0]
        times.append(1e3 * (time.perf_counter() - begin))
    return image, found, float(np.median(times))


def main():
    directory, found = Path(sys.argv[1]), {}
    for name in sys.argv[2:]:
        path = directory / f"{name}.onnx"
        times = {threads: run(path, threads)[2] for threads in (1, 2)}
        image, output, _ = run(path, 1)
        path.with_suffix(".in").write_bytes(image.astype("<f4").tobytes())
        kind = "<f4" if output.dtype.kind == "f" else "<i8"
        path.with_suffix(".out").write_bytes(output.astype(kind).tobytes())
        found[name] = {"in": image.shape, "out": output.shape, "ms": times}
    print(json.dumps({"version": onnxruntime.__version__, "models": found}))


if __name__ == "__main__":
    main()
