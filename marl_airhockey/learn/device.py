"""Device of torch that learns, chosen by name."""

from __future__ import annotations

import torch
from torch import Tensor

from marl_airhockey.types import Array


def torch_device(name: str) -> torch.device:
    """Return the device with a name.

    Args:
        name: "cpu", "cuda", "cuda:NUMBER", or "auto" for a GPU if there is one.

    Raises:
        ValueError: The name is none of these.
        RuntimeError: torch cannot use this GPU. The message contains a remedy.
    """
    if name == "auto":
        name = "cuda" if torch.cuda.is_available() else "cpu"
    kind, colon, number = name.partition(":")
    if kind not in ("cpu", "cuda") or (colon and not number.isdigit()):
        raise ValueError(f"device: {name!r}; expected cpu, cuda, cuda:NUMBER or auto")
    if kind == "cuda" and int(number or 0) >= torch.cuda.device_count():
        raise RuntimeError(
            f"device: torch {torch.__version__} sees {torch.cuda.device_count()} GPUs, "
            f"so there is no {name}; install torch for CUDA, or use the device cpu"
        )
    return torch.device(name)


def moved(array: Array, device: torch.device) -> Tensor:
    """Return an array as a tensor on a device.

    On the CPU it shares the memory of the array. The copy to a GPU is asynchronous.
    """
    tensor = torch.from_numpy(array)
    if device.type == "cpu":
        return tensor
    return tensor.pin_memory().to(device, non_blocking=True)
