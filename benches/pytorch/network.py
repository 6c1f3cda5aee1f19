"""The trainer's latent-flow network, as one writes it in PyTorch."""

import math
from dataclasses import dataclass

import torch
from torch import Tensor, nn
from torch.nn import functional as F


@dataclass(frozen=True)
class NetworkConfig:
    """Sizes and regularisation; the defaults are those of the preset `paper`."""

    stem_kernel: int = 6
    stem_stride: int = 4
    stem_channels: int = 24
    stage_channels: tuple[int, ...] = (32, 64, 96)
    keypoints: int = 0
    latent_dim: int = 96
    stochastic_depth: float = 0.3
    projection_width: int = 256
    hidden_width: int = 128
    dropout: float = 0.3


def _layer(layer: nn.Module, gain: float) -> nn.Module:
    """Random weights of variance `gain / inputs`, no bias."""
    nn.init.normal_(layer.weight, std=math.sqrt(gain / layer.weight[0].numel()))
    if layer.bias is not None:
        nn.init.zeros_(layer.bias)
    return layer


class StandardisedConvolution(nn.Module):
    """A 3x3 convolution whose filters are kept at mean 0 and a learnt length."""

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.weight = nn.Parameter(torch.randn(channels, channels, 3, 3))
        # Makes up for what a ReLU takes of the variance of its input.
        self.gain = nn.Parameter(torch.full((channels,), 1.713))
        self.bias = nn.Parameter(torch.zeros(channels))

    def forward(self, x: Tensor) -> Tensor:
        flat = self.weight.flatten(1)
        centred = flat - flat.mean(1, keepdim=True)
        length = (centred.square().mean(1, keepdim=True) * flat.shape[1] + 1e-6).sqrt()
        filters = (centred * (self.gain[:, None] / length)).view_as(self.weight)
        return F.conv2d(x, filters, self.bias, padding=1)


class Stage(nn.Module):
    """Halves rows and columns, then a residual block that single states skip while training."""

    def __init__(self, channels: int, wider: int, stochastic_depth: float) -> None:
        super().__init__()
        self.merge = _layer(nn.Conv2d(channels, wider, 2, stride=2), 2.0)
        self.neighbours = StandardisedConvolution(wider)
        # A small gain lets the block begin close to passing its input on.
        self.cell = _layer(nn.Conv2d(wider, wider, 1), 0.25)
        self.skip = stochastic_depth

    def forward(self, x: Tensor) -> Tensor:
        x = F.relu(self.merge(x))
        branch = self.cell(F.relu(self.neighbours(x)))
        if self.training and self.skip > 0:
            kept = torch.rand(len(x), 1, 1, 1) >= self.skip
            branch = branch * (kept / (1 - self.skip))
        return F.relu(x + branch)


class Keypoints(nn.Module):
    """For each keypoint its mean place under a softmax over all cells of a map."""

    def __init__(self, channels: int, count: int, latent_dim: int, cells: tuple[int, int]) -> None:
        super().__init__()
        self.logits = _layer(nn.Conv2d(channels, count, 1), 4.0)
        self.latent = _layer(nn.Linear(2 * count, latent_dim), 4.0)
        y, x = ((2 * torch.arange(n) + 1) / n - 1 for n in cells)
        places = torch.stack([x.expand(cells), y[:, None].expand(cells)], dim=-1)
        self.register_buffer("places", places.reshape(-1, 2), persistent=False)

    def forward(self, x: Tensor) -> Tensor:
        shares = self.logits(x).flatten(2).softmax(2)
        return self.latent((shares @ self.places).flatten(1))


class CameraEncoder(nn.Module):
    """The small residual network of one camera."""

    def __init__(self, rows: int, columns: int, frames: int, config: NetworkConfig) -> None:
        super().__init__()
        kernel, stride = config.stem_kernel, config.stem_stride
        multiple = 1 << len(config.stage_channels)
        # Patches in each direction, so many that every stage can halve them, and the padding that it takes.
        patches = [math.ceil(math.ceil(pixels / stride) / multiple) * multiple for pixels in (rows, columns)]
        over = [max((n - 1) * stride + kernel - pixels, 0) for n, pixels in zip(patches, (rows, columns))]
        top, left = over[0] // 2, over[1] // 2
        self.padding = (left, over[1] - left, top, over[0] - top)
        even = over[0] % 2 == 0 and over[1] % 2 == 0
        self.stem = _layer(
            nn.Conv2d(3 * frames, config.stem_channels, kernel, stride, padding=(top, left) if even else 0), 2.0
        )
        self.pads = not even
        widths = [config.stem_channels, *config.stage_channels]
        self.stages = nn.ModuleList(Stage(a, b, config.stochastic_depth) for a, b in zip(widths, widths[1:]))
        self.cells = (patches[0] // multiple, patches[1] // multiple)
        self.latent = _layer(nn.Linear(self.cells[0] * self.cells[1] * widths[-1], config.latent_dim), 1.0)
        self.keypoints = None
        if config.keypoints:
            first_map = (patches[0] // 2, patches[1] // 2)
            self.keypoints = Keypoints(widths[1], config.keypoints, config.latent_dim, first_map)

    def forward(self, pictures: Tensor) -> Tensor:
        x = F.pad(pictures, self.padding) if self.pads else pictures
        x = F.relu(self.stem(x))
        places: Tensor | float = 0.0
        for index, stage in enumerate(self.stages):
            x = stage(x)
            if index == 0 and self.keypoints is not None:
                places = self.keypoints(x)
        return self.latent(x.flatten(1)) + places


class FlowHead(nn.Module):
    """A multi-layer perceptron over `[z, z', z' - z]`, whose first layer is kept in three parts, since gradients
    are clipped by part."""

    def __init__(self, latent_dim: int, outputs: int, config: NetworkConfig) -> None:
        super().__init__()
        width = config.projection_width
        third = 2.0 / 3.0
        self.left = _layer(nn.Linear(latent_dim, width), third)
        self.reached = _layer(nn.Linear(latent_dim, width, bias=False), third)
        self.flow = _layer(nn.Linear(latent_dim, width, bias=False), third)
        self.hidden = _layer(nn.Linear(width, config.hidden_width), 2.0)
        self.output = _layer(nn.Linear(config.hidden_width, outputs), 0.1)
        self.dropout = config.dropout

    def forward(self, z: Tensor, goal: Tensor) -> Tensor:
        x = self.left(z) + self.reached(goal) + self.flow(goal - z)
        x = F.dropout(F.relu(x), self.dropout, self.training)
        x = F.dropout(F.relu(self.hidden(x)), self.dropout, self.training)
        return self.output(x)


class LatentFlowNetwork(nn.Module):
    """An encoder for each camera, and two heads that see the latents of two states and their difference."""

    def __init__(
        self, sizes: list[tuple[int, int]], frames: int, d_max: int, actions: int, config: NetworkConfig
    ) -> None:
        super().__init__()
        self.encoders = nn.ModuleList(CameraEncoder(*size, frames, config) for size in sizes)
        latent_dim = len(sizes) * config.latent_dim
        self.traversability = FlowHead(latent_dim, d_max, config)
        self.policy = FlowHead(latent_dim, actions, config)

    def encode(self, pictures: list[Tensor]) -> Tensor:
        """Latents of states, from `[states, frames * 3, rows, columns]` of each camera."""
        return torch.cat([encoder(x) for encoder, x in zip(self.encoders, pictures)], dim=1)

    def count(self) -> int:
        """Number of weights."""
        return sum(weight.numel() for weight in self.parameters())


def take_weights(network: LatentFlowNetwork, weights: dict[str, Tensor]) -> None:
    """Puts the trainer's weights, by its names and in its layouts, into the network."""

    def dense(layer: nn.Linear, name: str) -> None:
        layer.weight.copy_(weights.pop(f"{name}.weight").T)
        layer.bias.copy_(weights.pop(f"{name}.bias"))

    def patches(layer: nn.Conv2d, name: str, channels_first: bool) -> None:
        out, channels, rows, columns = layer.weight.shape
        values = weights.pop(f"{name}.weight").T
        if channels_first:
            values = values.reshape(out, channels, rows, columns)
        else:
            values = values.reshape(out, rows, columns, channels).permute(0, 3, 1, 2)
        layer.weight.copy_(values)
        layer.bias.copy_(weights.pop(f"{name}.bias"))

    with torch.no_grad():
        for camera, encoder in enumerate(network.encoders):
            name = f"encoders.{camera}"
            patches(encoder.stem, f"{name}.stem", channels_first=True)
            for index, stage in enumerate(encoder.stages):
                at = f"{name}.stages.{index}"
                patches(stage.merge, f"{at}.merge", channels_first=False)
                for part in ("weight", "gain", "bias"):
                    getattr(stage.neighbours, part).copy_(weights.pop(f"{at}.block.neighbours.{part}"))
                patches(stage.cell, f"{at}.block.cell", channels_first=False)
            # The trainer flattens its last map cell by cell, PyTorch channel by channel.
            values = weights.pop(f"{name}.latent.weight")
            values = values.reshape(*encoder.cells, -1, values.shape[1]).permute(3, 2, 0, 1)
            encoder.latent.weight.copy_(values.flatten(1))
            encoder.latent.bias.copy_(weights.pop(f"{name}.latent.bias"))
            if encoder.keypoints is not None:
                patches(encoder.keypoints.logits, f"{name}.keypoints.logits", channels_first=False)
                dense(encoder.keypoints.latent, f"{name}.keypoints.latent")
        for name in ("traversability", "policy"):
            head: FlowHead = getattr(network, name)
            for layer, part in ((head.left, "from"), (head.reached, "to"), (head.flow, "flow")):
                layer.weight.copy_(weights.pop(f"{name}.{part}").T)
            head.left.bias.copy_(weights.pop(f"{name}.bias"))
            dense(head.hidden, f"{name}.hidden")
            dense(head.output, f"{name}.output")
    if weights:
        raise SystemExit(f"weights that the network has no place for: {', '.join(weights)}")
