"""Functions that numba's code needs: memory, roots and long products, as LLVM text."""

from __future__ import annotations

import re

ARENA = 1 << 17
"""Size of the memory for arrays that the functions create, bytes. It is empty again
after each call. The functions of a world use a sixth of it."""
_RUNTIME = """
%header = type {{ i64, ptr, ptr, ptr, i64 }}

define ptr @NRT_MemInfo_alloc_aligned(i64 %size, i32 %align) {{
  %arena = call ptr @arena()
  %before = load i64, ptr %arena
  %more = add i64 %size, 191
  %whole = and i64 %more, -64
  %after = add i64 %before, %whole
  %full = icmp ugt i64 %after, {arena}
  br i1 %full, label %none, label %some
none:
  ret ptr null
some:
  store i64 %after, ptr %arena
  %head = getelementptr i8, ptr %arena, i64 %before
  %data = getelementptr i8, ptr %head, i64 64
  store i64 1, ptr %head
  %slot = getelementptr %header, ptr %head, i32 0, i32 3
  store ptr %data, ptr %slot
  %end = getelementptr %header, ptr %head, i32 0, i32 4
  store i64 %after, ptr %end
  ret ptr %head
}}

declare double @llvm.sqrt.f64(double)

define double @sqrt(double %x) {{
  %root = call double @llvm.sqrt.f64(double %x)
  ret double %root
}}

define void @NRT_MemInfo_call_dtor(ptr %head) {{
  %arena = call ptr @arena()
  %used = load i64, ptr %arena
  %slot = getelementptr %header, ptr %head, i32 0, i32 4
  %end = load i64, ptr %slot
  %last = icmp eq i64 %end, %used
  br i1 %last, label %free, label %done
free:
  %first = ptrtoint ptr %arena to i64
  %here = ptrtoint ptr %head to i64
  %start = sub i64 %here, %first
  store i64 %start, ptr %arena
  br label %done
done:
  ret void
}}

define void @NRT_incref(ptr %head) {{
  %none = icmp eq ptr %head, null
  br i1 %none, label %done, label %count
count:
  %before = load i64, ptr %head
  %after = add i64 %before, 1
  store i64 %after, ptr %head
  br label %done
done:
  ret void
}}

define void @NRT_decref(ptr %head) {{
  %none = icmp eq ptr %head, null
  br i1 %none, label %done, label %count
count:
  %before = load i64, ptr %head
  %after = sub i64 %before, 1
  store i64 %after, ptr %head
  %last = icmp eq i64 %after, 0
  br i1 %last, label %free, label %done
free:
  call void @NRT_MemInfo_call_dtor(ptr %head)
  br label %done
done:
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
"""Functions that numba's code needs: memory, flat views of arrays, and roots. The
function ``arena`` returns the address of the memory, whose first word is the number of
its used bytes. One thread has the memory for itself, so that the numbers of references
need no atomic operations. Those of numba take most of the time of a step."""
MEMORY = f"""
@memory = internal global [{ARENA} x i8] zeroinitializer, align 64

define internal ptr @arena() {{
  ret ptr @memory
}}
"""
LONG_PRODUCT = "__multi3"
WASM_RUNTIME = f"""
define void @{LONG_PRODUCT}(ptr %out, i64 %a, i64 %a_high, i64 %b, i64 %b_high)
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
_REFERENCES = re.compile(r"^define \w+ void @NRT_(inc|dec)ref\(.*?^}\n", re.M | re.S)


def without_references(text: str) -> str:
    """Return the LLVM text of a function that counts references as `_RUNTIME` does."""
    return _REFERENCES.sub(r"declare void @NRT_\1ref(ptr)\n", text)


def runtime_of(arena: int) -> str:
    """Return the LLVM text of what numba's code needs, with an arena of some bytes."""
    return _RUNTIME.format(arena=arena)
