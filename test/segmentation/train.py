"""Trains the network of rooms on folders of `lattice simulate images`, and writes it as ONNX.

    train.py --train DIR... --test NAME=DIR... --out rooms.onnx

The same folders, options and versions give the same network, also if it was ended and went on: OUT with the suffix
.pt has its state. What it was trained on, and how right it is on each test, goes into OUT with the suffix .json.
"""

import argparse
import copy
import json
import time
from pathlib import Path

import numpy as np
import torch
from PIL import Image
from torch import nn
from torch.nn import functional as F

HEIGHT, WIDTH = 144, 192  # of the input; the output has half of both
MEAN, STD = (0.485, 0.456, 0.406), (0.229, 0.224, 0.225)
NONE = 255


def conv(inputs, outputs, size=3, stride=1):
    return nn.Sequential(
        nn.Conv2d(inputs, outputs, size, stride, size // 2, bias=False),
        nn.BatchNorm2d(outputs),
        nn.ReLU(inplace=True),
    )


class Residual(nn.Module):
    def __init__(self, channels):
        super().__init__()
        self.first = conv(channels, channels)
        self.second = nn.Sequential(
            nn.Conv2d(channels, channels, 3, 1, 1, bias=False), nn.BatchNorm2d(channels)
        )

    def forward(self, x):
        return F.relu(x + self.second(self.first(x)))


class Pyramid(nn.Module):
    """What the whole image and its parts show, beside each pixel (Zhao et al. 2017)."""

    def __init__(self, channels, each, rows, columns):
        super().__init__()
        self.sizes = [(rows, columns), (rows // 3, columns // 3)]
        self.parts = nn.ModuleList(conv(channels, each, 1) for _ in self.sizes)
        self.join = conv(channels + each * len(self.sizes), channels, 1)
        self.rows, self.columns = rows, columns

    def forward(self, x):
        found = [x]
        for (rows, columns), part in zip(self.sizes, self.parts):
            pooled = part(F.avg_pool2d(x, (rows, columns)))
            found.append(F.interpolate(pooled, scale_factor=(float(rows), float(columns)), mode="nearest"))
        return self.join(torch.cat(found, 1))


class Rooms(nn.Module):
    """A U-Net (Ronneberger, Fischer & Brox 2015) with residuals and a pyramid at its bottom."""

    def __init__(self, classes):
        super().__init__()
        self.enter = nn.Sequential(conv(3, 16, 3, 2), conv(16, 16))
        self.down = nn.ModuleList(
            nn.Sequential(conv(a, b, 3, 2), Residual(b)) for a, b in [(16, 32), (32, 56), (56, 88)]
        )
        self.bottom = Pyramid(88, 24, HEIGHT // 16, WIDTH // 16)
        self.narrow = nn.ModuleList(conv(a, b, 1) for a, b in [(88, 56), (48, 32), (32, 16)])
        self.up = nn.ModuleList(conv(a, b) for a, b in [(112, 48), (64, 32), (32, 24)])
        self.leave = nn.Conv2d(24, classes, 1)

    def forward(self, x):
        skips = [self.enter(x)]
        for down in self.down:
            skips.append(down(skips[-1]))
        x = self.bottom(skips.pop())
        for narrow, up in zip(self.narrow, self.up):
            x = F.interpolate(narrow(x), scale_factor=2.0, mode="nearest")
            x = up(torch.cat([x, skips.pop()], 1))
        return self.leave(x)


def read(folder):
    """Images and labels of a folder, in the sizes of the input and of twice the output."""
    folder = Path(folder)
    info = json.loads((folder / "images.json").read_text())
    images, labels = [], []
    for entry in info["images"]:
        image = Image.open(folder / entry["color"]).convert("RGB")
        images.append(np.asarray(image))
        labels.append(np.asarray(Image.open(folder / entry["labels"])))
    names = [info["classes"][str(i)] for i in range(len(info["classes"]))]
    return torch.from_numpy(np.stack(images)), torch.from_numpy(np.stack(labels)), names


def fitted(images, labels):
    """A batch as the network sees it: stretched as the node does it, bytes as numbers from 0 to 1."""
    x = images.permute(0, 3, 1, 2).float() / 255
    x = F.interpolate(x, (HEIGHT, WIDTH), mode="bilinear", align_corners=False)
    y = F.interpolate(labels[:, None].float(), (HEIGHT // 2, WIDTH // 2), mode="nearest")[:, 0].long()
    return x, y


def normal(x):
    shape = (1, 3, 1, 1)
    return (x - torch.tensor(MEAN).view(shape)) / torch.tensor(STD).view(shape)


def augmented(images, labels, random):
    """Cut, flipped, in other light and other colours, blurred: one image each."""
    xs, ys = [], []
    for image, label in zip(images, labels):
        rows, columns = label.shape
        share = random.uniform(0.6, 1.0)
        h, w = int(rows * share), int(columns * min(1.0, share * random.uniform(0.85, 1.15)))
        top, left = random.integers(0, rows - h + 1), random.integers(0, columns - w + 1)
        image, label = image[top:top + h, left:left + w], label[top:top + h, left:left + w]
        if random.random() < 0.5:
            image, label = image.flip(1), label.flip(1)
        x, y = fitted(image[None], label[None])
        x = x ** float(np.exp(random.normal(0, 0.15))) * float(np.exp(random.normal(0, 0.2)))
        x = x * torch.from_numpy(np.exp(random.normal(0, 0.06, (1, 3, 1, 1)))).float()
        grey = x.mean(1, keepdim=True)
        x = grey + (x - grey) * float(random.uniform(0.4, 1.5))
        if random.random() < 0.15:
            # Hues turned round.
            x = x[:, random.permutation(3)]
        if random.random() < 0.25:
            x = F.avg_pool2d(x, 3, 1, 1, count_include_pad=False)
        xs.append(x.clamp(0, 1))
        ys.append(y)
    return torch.cat(xs), torch.cat(ys)


def measured(model, images, labels, classes):
    """Confusion of classes, true by found."""
    confusion = np.zeros((classes, classes), np.int64)
    model.eval()
    with torch.no_grad():
        for i in range(0, len(images), 16):
            x, y = fitted(images[i:i + 16], labels[i:i + 16])
            found = model(normal(x)).argmax(1)
            known = y != NONE
            pairs = (y[known] * classes + found[known]).numpy()
            confusion += np.bincount(pairs, minlength=classes**2).reshape(classes, classes)
    return confusion


def figures(confusion, names):
    right = confusion.diagonal()
    union = confusion.sum(0) + confusion.sum(1) - right
    seen = confusion.sum(1) > 0
    iou = np.where(union > 0, right / np.maximum(union, 1), 0)
    return {
        "pixel_accuracy": round(float(right.sum() / max(confusion.sum(), 1)), 4),
        "mean_iou": round(float(iou[seen].mean()), 4),
        "iou": {name: round(float(v), 3) for name, v, s in zip(names, iou, seen) if s},
    }


def shares(labels, classes):
    counts = torch.bincount(labels.flatten().long(), minlength=256)[:classes].double()
    return counts / counts.sum()


class Mean:
    """Running mean of the weights of a model, which needs no end of the training to be good."""

    def __init__(self, model):
        self.model = copy.deepcopy(model).eval()

    def take(self, model, step):
        keep = min(0.995, (1 + step) / (10 + step))
        with torch.no_grad():
            for mean, now in zip(self.model.state_dict().values(), model.state_dict().values()):
                if mean.is_floating_point():
                    mean.mul_(keep).add_(now, alpha=1 - keep)
                else:
                    mean.copy_(now)


def train(images, labels, classes, options):
    """The mean of the weights after so many steps; each step has its own random numbers."""
    torch.manual_seed(options.seed)
    model = Rooms(classes)
    mean = Mean(model)
    optimizer = torch.optim.AdamW(model.parameters(), options.rate, weight_decay=1e-2)
    weights = (shares(labels, classes) + 1e-4) ** -options.balance
    weights = (weights / (weights * shares(labels, classes)).sum()).clamp(max=8).float()
    state, first, lost, begin = options.out.with_suffix(".pt"), 0, [], time.time()
    if state.exists():
        first, *parts = torch.load(state)
        for part, saved in zip((model, mean.model, optimizer), parts):
            part.load_state_dict(saved)
    for step in range(first, options.steps):
        random = np.random.default_rng([options.seed, step])
        # No end in sight: a rate that falls with the root of the steps, after a start from below.
        rate = options.rate * min((step + 1) / 60, (1 + step / 400) ** -0.5)
        for group in optimizer.param_groups:
            group["lr"] = rate
        chosen = random.choice(len(images), options.batch, replace=False)
        x, y = augmented(images[chosen], labels[chosen], random)
        loss = F.cross_entropy(
            model.train()(normal(x)), y, weight=weights, ignore_index=NONE, label_smoothing=0.05
        )
        optimizer.zero_grad()
        loss.backward()
        nn.utils.clip_grad_norm_(model.parameters(), 5.0)
        optimizer.step()
        mean.take(model, step)
        lost.append(loss.item())
        if (step + 1) % 50 == 0:
            parts = [part.state_dict() for part in (model, mean.model, optimizer)]
            torch.save([step + 1, *parts], state.with_suffix(".tmp"))
            state.with_suffix(".tmp").replace(state)
            spent = f"{time.time() - begin:.0f} s, {time.process_time():.0f} s of processor"
            print(f"{step + 1}/{options.steps} loss {np.mean(lost[-50:]):.3f} {spent}", flush=True)
    return mean.model


def varint(value):
    found = b""
    while True:
        value, low = value >> 7, value & 127
        if not value:
            return found + bytes([low])
        found += bytes([low | 128])


def entry(key, value):
    """An entry of metadata_props, field 14 of an ONNX model."""
    text = lambda tag, s: bytes([tag]) + varint(len(s.encode())) + s.encode()
    both = text(0x0A, key) + text(0x12, value)
    return bytes([14 << 3 | 2]) + varint(len(both)) + both


def export(model, names, path, metadata):
    torch.onnx.export(
        model, torch.zeros(1, 3, HEIGHT, WIDTH), str(path), opset_version=13,
        input_names=["image"], output_names=["logits"], do_constant_folding=True,
    )
    with open(path, "ab") as file:
        file.write(entry("names", ",".join(names)))
        for key, value in metadata.items():
            file.write(entry(key, value))


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--train", nargs="+", required=True)
    parser.add_argument("--test", nargs="*", default=[])
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--steps", type=int, default=3000)
    parser.add_argument("--batch", type=int, default=8)
    parser.add_argument("--rate", type=float, default=3e-3)
    parser.add_argument("--balance", type=float, default=0.35, help="0: each pixel counts as much, 1: each class")
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    torch.set_num_threads(1)
    sets = [read(folder) for folder in options.train]
    names = sets[0][2]
    # Cameras have images of other sizes; each is stretched to that of the first.
    shape = sets[0][1].shape[1:]
    images, labels = [], []
    for x, y, given in sets:
        assert given == names, "the classes of all folders must be the same"
        if y.shape[1:] != shape:
            x = F.interpolate(x.permute(0, 3, 1, 2).float(), shape, mode="bilinear", align_corners=False)
            x = x.round().byte().permute(0, 2, 3, 1)
            y = F.interpolate(y[:, None].float(), shape, mode="nearest")[:, 0].byte()
        images.append(x)
        labels.append(y)
    images, labels = torch.cat(images), torch.cat(labels)
    model = train(images, labels, len(names), options)
    parameters = sum(p.numel() for p in model.parameters())
    report = {
        "seed": options.seed, "steps": options.steps, "batch": options.batch, "rate": options.rate,
        "balance": options.balance, "images": len(images), "parameters": parameters,
        "torch": torch.__version__, "tests": {},
    }
    for test in options.test:
        name, folder = test.split("=", 1)
        x, y, given = read(folder)
        assert given == names
        report["tests"][name] = figures(measured(model, x, y, len(names)), names)
        print(name, report["tests"][name], flush=True)
    mean, std = ([str(v) for v in values] for values in (MEAN, STD))
    export(model, names, options.out, {"mean": ",".join(mean), "std": ",".join(std), "seed": str(options.seed)})
    options.out.with_suffix(".json").write_text(json.dumps(report, indent=1) + "\n")
    print(json.dumps({"parameters": parameters, "bytes": options.out.stat().st_size}))


if __name__ == "__main__":
    main()
