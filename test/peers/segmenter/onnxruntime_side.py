"""One process of ONNX Runtime for test/peers/segmenter/run: the same options as `lattice bench segment`."""

import argparse
import json
import time

import numpy as np
import onnxruntime


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--model")
    parser.add_argument("--threads", type=int)
    parser.add_argument("--rounds", type=int)
    given = parser.parse_args()
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = given.threads
    session = onnxruntime.InferenceSession(given.model, options, providers=["CPUExecutionProvider"])
    image = session.get_inputs()[0]
    feed = {image.name: np.full(image.shape, 0.5, "f4")}
    session.run(None, feed)
    wall = []
    for _ in range(given.rounds):
        begin = time.perf_counter()
        session.run(None, feed)
        wall.append(time.perf_counter() - begin)
    print(json.dumps({"wall": wall}))


if __name__ == "__main__":
    main()
