"""Kernels as code of a GPU, or of this machine."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from marl_airhockey.device.kernel import KernelText
from marl_airhockey.sim.jit.runtime import runtime_of
from marl_airhockey.sim.jit.targets import (
    GPU,
    linked_module,
    machine_of,
)

HOST = "x86_64"
"""Target for tests of the kernels on this machine."""
THREADS = 128
"""Number of threads of a block."""
_BEGIN = "ptr %memory, ptr %shared, ptr %scratch, i64 %worlds, i64 %odd"
_STEP = (
    "ptr %memory, ptr %shared, ptr %starts, i64 %worlds, i64 %rows, i64 %odd, "
    "i64 %restarts, ptr %actions, ptr %observation, ptr %final, ptr %reward, "
    "ptr %ended, ptr %success"
)
_ONE_BEGIN = """
  %far = mul i64 %b, {size}
  %world = getelementptr i8, ptr %memory, i64 %far
  %away = mul i64 %b, {arena}
  %arena = getelementptr i8, ptr %scratch, i64 %away
  %done = call i32 @world.begin(ptr %world, ptr %shared, i1 %is_odd, ptr %arena)
"""
_ONE_STEP = """
  %restart = trunc i64 %restarts to i1
  %done = call i32 @world.step(ptr %memory, ptr %shared, ptr %starts, i64 %b,
    i64 %worlds, i64 %rows, i1 %is_odd, i1 %restart, ptr %actions, ptr %observation,
    ptr %final, ptr %reward, ptr %ended, ptr %success)
  %fine = icmp eq i32 %done, 1
  br i1 %fine, label %next, label %wrong
wrong:
  %far = mul i64 %b, {stride}
  %status = getelementptr i8, ptr %memory, i64 %far
  %failed = sub i32 1, %done
  store i32 %failed, ptr %status
  br label %next
"""
_THREAD = """
declare i32 @llvm.nvvm.read.ptx.sreg.tid.x()
declare i32 @llvm.nvvm.read.ptx.sreg.ctaid.x()
declare i32 @llvm.nvvm.read.ptx.sreg.ntid.x()
@arenas = internal addrspace(3) global [{threads} x ptr] undef, align 8

define internal ptr @arena() {{
  %tid = call i32 @llvm.nvvm.read.ptx.sreg.tid.x()
  %slot = getelementptr [{threads} x ptr], ptr addrspace(3) @arenas, i32 0, i32 %tid
  %found = load ptr, ptr addrspace(3) %slot
  ret ptr %found
}}

define internal void @set_arena(ptr %arena) {{
  %tid = call i32 @llvm.nvvm.read.ptx.sreg.tid.x()
  %slot = getelementptr [{threads} x ptr], ptr addrspace(3) @arenas, i32 0, i32 %tid
  store ptr %arena, ptr addrspace(3) %slot
  store i64 64, ptr %arena
  ret void
}}
"""
_LOOP = """
@current = internal global ptr null

define internal ptr @arena() {
  %found = load ptr, ptr @current
  ret ptr %found
}

define internal void @set_arena(ptr %arena) {
  store ptr %arena, ptr @current
  store i64 64, ptr %arena
  ret void
}
"""


def kernel_module(kernels: KernelText, texts: Mapping[str, str], target: str) -> Any:
    """Return the optimised LLVM module with the kernels ``begin`` and ``step``.

    Args:
        kernels: Functions of one world.
        texts: LLVM texts of the functions of a control step, by name.
        target: `GPU`, or `HOST` for functions that call one world after the other.
    """
    memory = {"size": kernels.size, "stride": kernels.stride, "arena": kernels.arena}
    own = _THREAD.format(threads=THREADS) if target == GPU else _LOOP
    wrapped = _on_gpu if target == GPU else _on_host
    loops = [
        wrapped("begin", _BEGIN, _ONE_BEGIN.format(**memory), "br label %next"),
        wrapped("step", _STEP, _ONE_STEP.format(**memory), ""),
    ]
    parts = {name: texts[name] for name in kernels.functions}
    whole = runtime_of(kernels.arena) + own + kernels.text() + "".join(loops)
    return linked_module(whole, parts, machine_of(target), ("begin", "step"))


def _on_gpu(name: str, arguments: str, body: str, end: str) -> str:
    return f"""
define ptx_kernel void @{name}({arguments}) {{
  %tid = call i32 @llvm.nvvm.read.ptx.sreg.tid.x()
  %block = call i32 @llvm.nvvm.read.ptx.sreg.ctaid.x()
  %threads = call i32 @llvm.nvvm.read.ptx.sreg.ntid.x()
  %first = mul i32 %block, %threads
  %number = add i32 %first, %tid
  %b = zext i32 %number to i64
  %is_odd = trunc i64 %odd to i1
  %inside = icmp ult i64 %b, %worlds
  br i1 %inside, label %run, label %next
run:
{body}
  {end}
next:
  ret void
}}
"""


def _on_host(name: str, arguments: str, body: str, end: str) -> str:
    return f"""
define void @{name}({arguments}) {{
entry:
  %is_odd = trunc i64 %odd to i1
  br label %head
head:
  %b = phi i64 [ 0, %entry ], [ %later, %next ]
  %inside = icmp ult i64 %b, %worlds
  br i1 %inside, label %run, label %end
run:
{body}
  {end}
next:
  %later = add i64 %b, 1
  br label %head
end:
  ret void
}}
"""
