"""Launch of kernels: on a GPU by cuda-core, or on this machine by llvmlite."""

from __future__ import annotations

import ctypes
from abc import ABC, abstractmethod

import torch
from llvmlite import binding

from marl_airhockey.device.module import THREADS
from marl_airhockey.sim.core.errors import require


class Launcher(ABC):
    """Compiled kernels of a scenario. All arguments are 64-bit integers."""

    @abstractmethod
    def launch(self, kernel: str, worlds: int, *arguments: int) -> None:
        """Call a kernel for a number of worlds.

        Args:
            kernel: Name of the kernel, ``begin`` or ``step``.
            worlds: Number of worlds.
            *arguments: Addresses and numbers.
        """


class HostLauncher(Launcher):
    """Kernels on this machine, which call one world after the other.

    Args:
        code: Bitcode of the kernels, see `code.device_code`.
    """

    def __init__(self, code: bytes) -> None:
        binding.initialize_native_target()
        binding.initialize_native_asmprinter()
        target = binding.Target.from_default_triple()
        machine = target.create_target_machine(opt=3, jit=True)
        module = binding.parse_bitcode(code)
        module.triple, module.data_layout = machine.triple, str(machine.target_data)
        self._engine = binding.create_mcjit_compiler(module, machine)
        self._engine.finalize_object()

    def launch(self, kernel: str, worlds: int, *arguments: int) -> None:
        address = self._engine.get_function_address(kernel)
        kinds = [ctypes.c_int64] * len(arguments)
        ctypes.CFUNCTYPE(None, *kinds)(address)(*arguments)


class CudaLauncher(Launcher):
    """Kernels on a GPU, in the current stream of torch.

    Args:
        code: PTX of the kernels, see `code.device_code`.
        device: Index of the GPU.

    Raises:
        RuntimeError: cuda-core is not installed. The message states how to install it.
    """

    def __init__(self, code: bytes, device: int) -> None:
        require("cuda.core", "cuda")
        from cuda.core import Device, ObjectCode

        self._device = device
        # The thread's current GPU is again the one before.
        with torch.cuda.device(device):
            Device(device).set_current()
            loaded = ObjectCode.from_ptx(code)
            names = "begin", "step"
            self._kernels = {name: loaded.get_kernel(name) for name in names}

    def launch(self, kernel: str, worlds: int, *arguments: int) -> None:
        from cuda.core import LaunchConfig, launch

        config = LaunchConfig(grid=-(-worlds // THREADS), block=THREADS)
        values = [ctypes.c_int64(value) for value in arguments]
        with torch.cuda.device(self._device):
            stream = _TorchStream(torch.cuda.current_stream())
            launch(stream, config, self._kernels[kernel], *values)


class _TorchStream:
    """Stream of torch, by the protocol of cuda-core."""

    def __init__(self, stream: torch.cuda.Stream) -> None:
        self._stream = stream

    def __cuda_stream__(self) -> tuple[int, int]:
        return 0, self._stream.cuda_stream
