"""Code for other machines, from the same source as the code of this machine.

Numba's LLVM text hardly depends on the processor, and llvmlite has the targets of other
machines built in. So the compiled functions of a pipeline also become a WebAssembly
module or an object for another processor, with results that are equal in every bit.

The text must not be optimised before: numba optimises for the sizes of pointers of this
machine. `UNOPTIMISED` therefore has to be set before a process imports numba.
"""

from __future__ import annotations

import importlib
import re
import subprocess
import sys
import tempfile
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from llvmlite import binding

from marl_airhockey.sim.jit.runtime import (
    ARENA,
    LONG_PRODUCT,
    MEMORY,
    WASM_RUNTIME,
    runtime_of,
    without_references,
)

UNOPTIMISED = {
    "NUMBA_OPT": "0",
    "NUMBA_CPU_NAME": "generic",
    "NUMBA_CPU_FEATURES": "",
    "MARL_AIRHOCKEY_PRECOMPILED": "0",
}
"""Environment of a process whose compiled functions can be translated."""


class CodeTarget(NamedTuple):
    """Machine for which code can be translated."""

    triple: str
    processor: str
    features: str
    suffix: str
    """Suffix of a file of code."""


TARGETS = {
    "wasm32": CodeTarget(
        "wasm32-unknown-unknown",
        "generic",
        "+bulk-memory,+nontrapping-fptoint,+sign-ext",
        ".wasm",
    ),
    "aarch64": CodeTarget("aarch64-unknown-linux-gnu", "generic", "", ".o"),
    "x86_64": CodeTarget("x86_64-unknown-linux-gnu", "x86-64", "", ".o"),
}
"""Targets of exported code by name."""
GPU = "nvptx64"
MACHINES = {
    **TARGETS,
    GPU: CodeTarget("nvptx64-nvidia-cuda", "sm_80", "+ptx80", ".ptx"),
}
"""All targets by name."""

_ENTRY = """
declare i32 @inner.{name}(ptr, ptr, ptr, ptr, i64, i64, ptr, i64, i64, i64)

define i32 @{name}(ptr %where, i64 %length, i64 %worlds) {{
  %going = alloca i8
  %error = alloca ptr
  store i64 64, ptr @memory
  %status = call i32 @inner.{name}(ptr %going, ptr %error, ptr null, ptr null,
    i64 %length, i64 8, ptr %where, i64 %length, i64 8, i64 %worlds)
  %fine = icmp eq i32 %status, 0
  %value = load i8, ptr %going
  %whole = zext i8 %value to i32
  %result = select i1 %fine, i32 %whole, i32 -1
  ret i32 %result
}}
"""
"""Function with the plain arguments of a pipeline's part. It returns 1, or 0 to end the
pipeline, or -1 if it has failed."""


def text_of(kernel: Any) -> str:
    """Return the LLVM text of the only signature of a compiled function."""
    (code,) = kernel.overloads.values()
    return str(code.library.get_llvm_str())


def check_target(target: str) -> None:
    """Raise a ValueError if a target is unknown."""
    if target not in TARGETS:
        raise ValueError(
            f"target {target!r} is unknown; there are {', '.join(TARGETS)}"
        )


def object_code(parts: Mapping[str, str], target: str) -> bytes:
    """Return an object file with the parts of a pipeline as functions.

    Args:
        parts: LLVM texts by the names of the functions, see `text_of`.
        target: Name of the target, see `TARGETS`.

    Raises:
        ValueError: The target is unknown, or the code needs a function of the C library
            of this machine.
    """
    check_target(target)
    machine = machine_of(target)
    return bytes(machine.emit_object(optimised(parts, target, machine)))


def optimised(parts: Mapping[str, str], target: str, machine: Any) -> Any:
    """Return the LLVM module of an object file, see `object_code`."""
    runtime = runtime_of(ARENA) + MEMORY + (WASM_RUNTIME if target == "wasm32" else "")
    text = runtime + "".join(_ENTRY.format(name=name) for name in parts)
    return linked_module(text, parts, machine, (*parts, LONG_PRODUCT))


def linked_module(
    text: str, parts: Mapping[str, str], machine: Any, public: Collection[str]
) -> Any:
    """Return an optimised LLVM module.

    Args:
        text: LLVM text of the functions that call the parts.
        parts: LLVM texts by the names of the functions, see `text_of`.
        machine: LLVM machine of the target.
        public: Names of the functions that are called from outside.

    Raises:
        ValueError: The code needs a function of the C library of this machine.
    """
    whole = _parsed(text, machine)
    for name, part in parts.items():
        whole.link_in(_renamed(part, name, machine))
    for function in whole.functions:
        if not function.is_declaration and function.name not in public:
            function.linkage = "internal"
    for variable in whole.global_variables:
        if not variable.is_declaration:
            variable.linkage = "internal"
    options = binding.create_pipeline_tuning_options(speed_level=3)
    builder = binding.create_pass_builder(machine, options)
    builder.getModulePassManager().run(whole, builder)
    needed = [
        f.name
        for f in whole.functions
        if f.is_declaration and not f.name.startswith("llvm.")
    ]
    if needed:
        raise ValueError(
            f"{', '.join(needed)}: this code calls functions of the C library, whose "
            "results differ between machines; use those of `elementary`"
        )
    return whole


def linked(code: bytes, names: list[str]) -> bytes:
    """Return a WebAssembly module from an object file.

    Args:
        code: Object file for wasm32, see `object_code`.
        names: Names of the functions that the module exports.

    Raises:
        ModuleNotFoundError: The linker is not installed.
    """
    try:
        importlib.import_module("ziglang")
    except ImportError as error:
        raise ModuleNotFoundError(
            "a WebAssembly module needs a linker: pip install 'marl_airhockey[export]'"
        ) from error
    with tempfile.TemporaryDirectory() as folder:
        source, result = Path(folder) / "code.o", Path(folder) / "code.wasm"
        source.write_bytes(code)
        words = [sys.executable, "-m", "ziglang", "wasm-ld", str(source)]
        words += ["--no-entry", "--strip-all", "--gc-sections", "--export=__heap_base"]
        words += [*(f"--export={name}" for name in names), "-o", str(result)]
        subprocess.run(words, check=True)
        return result.read_bytes()


def machine_of(target: str) -> Any:
    """Return the LLVM machine of a target, by name."""
    binding.initialize_all_targets()
    binding.initialize_all_asmprinters()
    triple, processor, features, _ = MACHINES[target]
    return binding.Target.from_triple(triple).create_target_machine(
        cpu=processor, features=features, opt=3, reloc="static"
    )


def _parsed(text: str, machine: Any) -> Any:
    layout = str(machine.target_data)
    if "target datalayout" not in text:
        # Without it, 64-bit integers are read in two halves, whose addresses may be odd
        # multiples of 4.
        text = f'target datalayout = "{layout}"\n{text}'
    module = binding.parse_assembly(text)
    module.triple, module.data_layout = machine.triple, layout
    return module


def _renamed(text: str, name: str, machine: Any) -> Any:
    """Return the module of a part whose function has the name that `_ENTRY` calls.

    Its wrappers for Python are not linked with other code, so they disappear.
    """
    (main,) = set(re.findall(r"^define i32 @(_ZN\d+loop_\w+kernel\w+)\(", text, re.M))
    module = _parsed(without_references(text), machine)
    module.get_function(main).name = f"inner.{name}"
    return module
