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
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

from llvmlite import binding

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
"""Targets by name."""

ARENA = 1 << 17
"""Size of the memory for arrays that the functions create, bytes. It is empty again
after each call. The functions of a world use a sixth of it."""
_RUNTIME = f"""
%header = type {{ i64, ptr, ptr, ptr, i64 }}
@arena = internal global [{ARENA} x i8] zeroinitializer, align 64
@used = internal global i64 0

define ptr @NRT_MemInfo_alloc_aligned(i64 %size, i32 %align) {{
  %before = load i64, ptr @used
  %more = add i64 %size, 191
  %whole = and i64 %more, -64
  %after = add i64 %before, %whole
  %full = icmp ugt i64 %after, {ARENA}
  br i1 %full, label %none, label %some
none:
  ret ptr null
some:
  store i64 %after, ptr @used
  %head = getelementptr i8, ptr @arena, i64 %before
  %data = getelementptr i8, ptr %head, i64 64
  store i64 1, ptr %head
  %slot = getelementptr %header, ptr %head, i32 0, i32 3
  store ptr %data, ptr %slot
  ret ptr %head
}}

declare double @llvm.sqrt.f64(double)

define double @sqrt(double %x) {{
  %root = call double @llvm.sqrt.f64(double %x)
  ret double %root
}}

define void @NRT_MemInfo_call_dtor(ptr %header) {{
  ret void
}}

define i32 @numba_attempt_nocopy_reshape(i64 %n, ptr %shape, ptr %strides,
    i64 %new_n, ptr %new_shape, ptr %new_strides, i64 %size, i32 %fortran) {{
  store i64 %size, ptr %new_strides
  %flat = icmp eq i64 %new_n, 1
  %done = zext i1 %flat to i32
  ret i32 %done
}}
"""
"""What numba's code needs from outside: memory, flat views of arrays, and roots."""
_LONG_PRODUCT = "__multi3"
_WASM_RUNTIME = f"""
define void @{_LONG_PRODUCT}(ptr %out, i64 %a, i64 %a_high, i64 %b, i64 %b_high)
    noinline optnone {{
  %a0 = and i64 %a, 4294967295
  %a1 = lshr i64 %a, 32
  %b0 = and i64 %b, 4294967295
  %b1 = lshr i64 %b, 32
  %p00 = mul i64 %a0, %b0
  %p01 = mul i64 %a0, %b1
  %p10 = mul i64 %a1, %b0
  %p11 = mul i64 %a1, %b1
  %carry = lshr i64 %p00, 32
  %middle = add i64 %p10, %carry
  %middle_low = and i64 %middle, 4294967295
  %middle_high = lshr i64 %middle, 32
  %other = add i64 %p01, %middle_low
  %other_high = lshr i64 %other, 32
  %sum = add i64 %p11, %middle_high
  %upper = add i64 %sum, %other_high
  %cross = mul i64 %a_high, %b
  %cross_2 = mul i64 %a, %b_high
  %with = add i64 %upper, %cross
  %high = add i64 %with, %cross_2
  %low = mul i64 %a, %b
  store i64 %low, ptr %out
  %second = getelementptr i64, ptr %out, i32 1
  store i64 %high, ptr %second
  ret void
}}
"""
"""Product of numbers of 128 bits, which LLVM calls and WebAssembly does not have."""
_ENTRY = """
declare i32 @inner.{name}(ptr, ptr, ptr, ptr, i64, i64, ptr, i64, i64, i64)

define i32 @{name}(ptr %where, i64 %length, i64 %worlds) {{
  %going = alloca i8
  %error = alloca ptr
  store i64 0, ptr @used
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
    runtime = _RUNTIME + (_WASM_RUNTIME if target == "wasm32" else "")
    whole = _parsed(runtime + "".join(_ENTRY.format(name=n) for n in parts), machine)
    for name, text in parts.items():
        whole.link_in(_renamed(text, name, machine))
    for function in whole.functions:
        outside = (*parts, _LONG_PRODUCT)
        if not function.is_declaration and function.name not in outside:
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
    triple, processor, features, _ = TARGETS[target]
    return binding.Target.from_triple(triple).create_target_machine(
        cpu=processor, features=features, opt=3, reloc="static"
    )


def _parsed(text: str, machine: Any) -> Any:
    module = binding.parse_assembly(text)
    module.triple, module.data_layout = machine.triple, str(machine.target_data)
    return module


def _renamed(text: str, name: str, machine: Any) -> Any:
    """Return the module of a part whose function has the name that `_ENTRY` calls.

    Its wrappers for Python are not linked with other code, so they disappear.
    """
    (main,) = set(re.findall(r"^define i32 @(_ZN\d+loop_\w+kernel\w+)\(", text, re.M))
    module = _parsed(text, machine)
    module.get_function(main).name = f"inner.{name}"
    return module
