"""Networks for the tests of the segmenter, with random weights, and models that must be refused.

    onnx_models.py DIRECTORY             writes NAME.onnx of each, prints their names as JSON
    onnx_models.py DIRECTORY --large     networks to measure times with
"""

import json
import sys
from pathlib import Path

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

CLASSES = 12


class Graph:
    """Nodes and weights, one after the other."""

    def __init__(self, seed, opset=17):
        self.nodes, self.weights, self.random = [], [], np.random.default_rng(seed)
        self.opset, self.count = opset, 0

    def add(self, operator, *inputs, **attributes):
        self.count += 1
        out = f"{operator}_{self.count}"
        self.nodes.append(helper.make_node(operator, list(inputs), [out], name=out, **attributes))
        return out

    def given(self, values):
        self.count += 1
        name = f"given_{self.count}"
        self.weights.append(numpy_helper.from_array(np.asarray(values), name))
        return name

    def weight(self, *shape, scale=None):
        fan_in = int(np.prod(shape[1:])) or 1
        scale = scale or (2 / fan_in) ** 0.5
        return self.given((self.random.standard_normal(shape) * scale).astype("f4"))

    def conv(self, x, inputs, outputs, kernel=3, stride=1, dilation=1, group=1, relu=True):
        weights = self.weight(outputs, inputs // group, kernel, kernel)
        pad = dilation * (kernel // 2)
        x = self.add(
            "Conv", x, weights, self.weight(outputs, scale=0.1), kernel_shape=[kernel] * 2,
            strides=[stride] * 2, pads=[pad] * 4, dilations=[dilation] * 2, group=group,
        )
        return self.add("Relu", x) if relu else x

    def norm(self, x, channels):
        near_one = lambda: self.given((1 + 0.1 * self.random.random(channels)).astype("f4"))
        shift = lambda: self.weight(channels, scale=0.1)
        return self.add("BatchNormalization", x, near_one(), shift(), shift(), near_one())

    def resize(self, x, height, width, channels, mode="half_pixel"):
        sizes = self.given(np.array([1, channels, height, width], "i8"))
        return self.add("Resize", x, "", "", sizes, mode="linear", coordinate_transformation_mode=mode)

    def linear(self, x, inputs, outputs):
        x = self.add("MatMul", x, self.given(
            (self.random.standard_normal((inputs, outputs)) * inputs**-0.5).astype("f4")))
        return self.add("Add", x, self.weight(outputs, scale=0.1))

    def model(self, out, shape, height, width, kind=TensorProto.FLOAT, inputs=None, names=None):
        image = helper.make_tensor_value_info("image", TensorProto.FLOAT, [1, 3, height, width])
        result = helper.make_tensor_value_info(out, kind, shape)
        graph = helper.make_graph(self.nodes, "graph", inputs or [image], [result], self.weights)
        model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", self.opset)], ir_version=8)
        if names:
            helper.set_model_props(model, {"names": names})
        return model


def psp(classes_out=False, k=1, c=1):
    """Pyramid pooling, as PSPNet has it: logits at a quarter of the size, or classes."""
    height, width, g = 96 * k, 144 * k, Graph(1)
    x = g.conv("image", 3, 16 * c, stride=2)
    x = g.norm(g.conv(x, 16 * c, 24 * c, stride=2), 24 * c)
    x = g.conv(x, 24 * c, 32 * c, stride=2)
    h, w = height // 8, width // 8
    branches = [x]
    for bins in (1, 2, 3, 6):
        kernel = [h // bins, w // bins]
        y = g.add("AveragePool", x, kernel_shape=kernel, strides=kernel)
        branches.append(g.resize(g.conv(y, 32 * c, 8 * c, kernel=1), h, w, 8 * c))
    x = g.conv(g.add("Concat", *branches, axis=1), 64 * c, 32 * c)
    x = g.conv(x, 32 * c, CLASSES, kernel=1, relu=False)
    x = g.resize(x, 2 * h, 2 * w, CLASSES)
    if classes_out:
        x = g.add("ArgMax", x, axis=1, keepdims=0)
        return g.model(x, [1, 2 * h, 2 * w], height, width, TensorProto.INT64)
    names = "{" + ", ".join(f"{i}: 'class {i}'" for i in range(CLASSES)) + "}"
    return g.model(x, [1, CLASSES, 2 * h, 2 * w], height, width, names=names)


def deeplab(k=1, c=1):
    """Depthwise and dilated convolutions with an average of all, as DeepLab has them: full size."""
    height, width, g = 96 * k, 128 * k, Graph(2)
    x = g.conv("image", 3, 16 * c, stride=2)
    x = g.norm(g.conv(x, 16 * c, 16 * c, group=16 * c), 16 * c)
    x = g.conv(x, 16 * c, 32 * c, stride=2)
    h, w = height // 4, width // 4
    branches = [g.conv(x, 32 * c, 8 * c, kernel=1)]
    branches += [g.conv(x, 32 * c, 8 * c, dilation=dilation) for dilation in (2, 4, 6)]
    y = g.conv(g.add("GlobalAveragePool", x), 32 * c, 8 * c, kernel=1)
    branches.append(g.resize(y, h, w, 8 * c))
    x = g.conv(g.add("Concat", *branches, axis=1), 40 * c, 32 * c, kernel=1)
    x = g.add("Clip", x, g.given(np.array(0, "f4")), g.given(np.array(6, "f4")))
    x = g.conv(x, 32 * c, CLASSES, kernel=1, relu=False)
    x = g.resize(x, height, width, CLASSES, mode="align_corners")
    return g.model(x, [1, CLASSES, height, width], height, width)


def segformer(k=1, c=1):
    """Attention over overlapping patches with keys thinned out, as SegFormer has it: a quarter."""
    height, width, dim, heads, g = 64 * k, 96 * k, 32 * c, 2, Graph(3)
    x = g.conv("image", 3, dim, kernel=7, stride=4, relu=False)
    h, w = height // 4, width // 4
    shape = lambda *s: g.given(np.array(s, "i8"))
    tokens = g.add("Transpose", g.add("Reshape", x, shape(1, dim, h * w)), perm=[0, 2, 1])
    for _ in range(2):
        normed = g.add("LayerNormalization", tokens, g.weight(dim, scale=1), g.weight(dim, scale=0.1), axis=-1)
        image = g.add("Reshape", g.add("Transpose", normed, perm=[0, 2, 1]), shape(1, dim, h, w))
        few = g.add("Conv", image, g.weight(dim, dim, 4, 4), kernel_shape=[4, 4], strides=[4, 4])
        few = g.add("Transpose", g.add("Reshape", few, shape(1, dim, h * w // 16)), perm=[0, 2, 1])
        split = lambda x, n: g.add(
            "Transpose", g.add("Reshape", x, shape(1, n, heads, dim // heads)), perm=[0, 2, 1, 3])
        query = split(g.linear(normed, dim, dim), h * w)
        key = split(g.linear(few, dim, dim), h * w // 16)
        value = split(g.linear(few, dim, dim), h * w // 16)
        fit = g.add("MatMul", query, g.add("Transpose", key, perm=[0, 1, 3, 2]))
        fit = g.add("Softmax", g.add("Div", fit, g.given(np.array((dim / heads) ** 0.5, "f4"))), axis=-1)
        seen = g.add("Transpose", g.add("MatMul", fit, value), perm=[0, 2, 1, 3])
        tokens = g.add("Add", tokens, g.linear(g.add("Reshape", seen, shape(1, h * w, dim)), dim, dim))
        y = g.linear(tokens, dim, 2 * dim)
        half = lambda v: g.given(np.array(v, "f4"))
        erf = g.add("Add", g.add("Erf", g.add("Div", y, half(2**0.5))), half(1.0))
        gelu = g.add("Mul", g.add("Mul", y, erf), half(0.5))
        tokens = g.add("Add", tokens, g.linear(gelu, 2 * dim, dim))
    x = g.add("Reshape", g.add("Transpose", tokens, perm=[0, 2, 1]), shape(1, dim, h, w))
    x = g.conv(x, dim, CLASSES, kernel=1, relu=False)
    return g.model(x, [1, CLASSES, h, w], height, width)


def red(named=True):
    """Class 1 where a pixel is rather red, class 0 where it is not; any size."""
    g = Graph(4)
    weights = np.zeros((2, 3, 1, 1), "f4")
    weights[1, 0] = 4
    x = g.add("Conv", "image", g.given(weights), g.given(np.array([2, 0], "f4")))
    size = [1, 3, "height", "width"]
    image = helper.make_tensor_value_info("image", TensorProto.FLOAT, size)
    names = "other, red" if named else None
    return g.model(x, [1, 2, "height", "width"], 0, 0, inputs=[image], names=names)


def refused():
    """Models that cannot be used."""

    def one(operator, *inputs, graph=None, shape=(1, 2, 8, 8), **attributes):
        g = graph or Graph(5)
        return g.model(g.add(operator, *inputs, **attributes), list(shape), 8, 8)

    huge = one("Identity", "image")
    weights = huge.graph.initializer.add()
    weights.name, weights.data_type = "huge", TensorProto.FLOAT
    weights.dims.extend([50_000, 50_000])
    cut = one("Identity", "image")
    weights = cut.graph.initializer.add()
    weights.name, weights.data_type, weights.raw_data = "cut", TensorProto.FLOAT, bytes(16)
    weights.dims.extend([100])
    elsewhere = one("Identity", "image")
    weights = elsewhere.graph.initializer.add()
    weights.name, weights.data_type = "elsewhere", TensorProto.FLOAT
    weights.data_location = TensorProto.EXTERNAL
    weights.dims.extend([4])
    entry = weights.external_data.add()
    entry.key, entry.value = "location", "../../etc/passwd"
    made = Graph(6)
    made.add("ConstantOfShape", made.given(np.array([100_000, 100_000], "i8")))
    # Sizes that stand nowhere: a product of constants, doubled again and again, spread from both sides.
    product = Graph(10)
    side = product.given(np.array([100_000], "i8"))
    ones = product.given(np.array([1], "i8"))
    both = product.add("Concat", product.add("Mul", side, ones), product.add("Mul", side, ones), axis=0)
    product.add("ConstantOfShape", both)
    doubled = Graph(11)
    grown = doubled.given(np.zeros([1, 1024], "f4"))
    for _ in range(40):
        grown = doubled.add("Concat", grown, grown, axis=0)
    spread = Graph(12)
    wide = lambda shape: spread.add("ConstantOfShape", spread.given(np.array(shape, "i8")))
    spread.add("Add", wide([100_000, 1]), wide([1, 100_000]))
    inner = helper.make_graph(
        [helper.make_node("Identity", ["image"], ["then"])], "then", [],
        [helper.make_tensor_value_info("then", TensorProto.FLOAT, [1, 3, 8, 8])])
    branch = Graph(13)
    branch.add("If", branch.given(np.array(True)), then_branch=inner, else_branch=inner)
    pair = Graph(7)
    inputs = [helper.make_tensor_value_info(n, TensorProto.FLOAT, [1, 3, 8, 8]) for n in "ab"]
    pair = pair.model(pair.add("Add", "a", "b"), [1, 3, 8, 8], 8, 8, inputs=inputs)
    grey = Graph(8)
    inputs = [helper.make_tensor_value_info("image", TensorProto.FLOAT, [1, 1, 8, 8])]
    grey = grey.model(grey.add("Relu", "image"), [1, 1, 8, 8], 8, 8, inputs=inputs)
    flat = Graph(9)
    flat = flat.model(flat.add("GlobalAveragePool", "image"), [1, 3, 1, 1], 8, 8)
    flat.graph.node.append(helper.make_node("Flatten", [flat.graph.output[0].name], ["flat"]))
    flat.graph.output[0].name = "flat"
    flat.graph.output[0].type.tensor_type.shape.Clear()
    lost = one("Identity", "image")
    lost.graph.output[0].name = "nowhere"
    named = one("Identity", "image", shape=(1, 3, 8, 8))
    helper.set_model_props(named, {"names": "wall, floor"})
    return {
        "huge": huge, "cut": cut, "elsewhere": elsewhere, "pair": pair, "grey": grey, "flat": flat,
        "lost": lost, "named": named, "made": one("Identity", "image", graph=made),
        "product": one("Identity", "image", graph=product), "doubled": one("Identity", "image", graph=doubled),
        "spread": one("Identity", "image", graph=spread), "branch": one("Identity", "image", graph=branch),
        "unknown": one("Frobnicate", "image"),
    }


def write(directory, models):
    for name, model in models.items():
        (directory / f"{name}.onnx").write_bytes(model.SerializeToString())
    print(json.dumps(sorted(models)))


def main():
    directory = Path(sys.argv[1])
    if "--large" in sys.argv:
        large = {"psp": psp(k=5, c=2), "deeplab": deeplab(k=4, c=2), "segformer": segformer(k=4, c=2)}
        write(directory, large)
        return
    models = {"psp": psp(), "psp_classes": psp(True), "deeplab": deeplab(), "segformer": segformer()}
    for model in models.values():
        onnx.checker.check_model(model, full_check=True)
    (directory / "text.onnx").write_text("This is a letter.\n")
    write(directory, models | {"red": red(), "open": red(named=False)} | refused())


if __name__ == "__main__":
    main()
