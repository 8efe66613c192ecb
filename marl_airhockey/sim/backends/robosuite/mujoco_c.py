"""Functions of MuJoCo's C library for compiled code, bound by name for caching."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import llvmlite.binding as llvm
import mujoco
from numba import types

llvm.load_library_permanently(
    str(next(iter(sorted(Path(mujoco.__file__).parent.glob("*mujoco*.[sd]*")))))
)


def _function(name: str, *arguments: Any) -> Any:
    return types.ExternalFunction(name, types.void(types.intp, *arguments))


_p, _i = types.intp, types.int32
step1 = _function("mj_step1", _p)
"""First half of a step (model, data): values that follow from qpos and qvel."""
step2 = _function("mj_step2", _p)
"""Second half of a step (model, data): forces, accelerations, integration."""
full_mass = _function("mj_fullM", _p, _p)
"""Joint-space inertia (model, (nv, nv) to fill, data's qM)."""
site_jacobian = _function("mj_jacSite", _p, _p, _p, _i)
"""Jacobian of a site (model, data, (3, nv) and (3, nv) to fill, site)."""
jacobian_rate = _function("mj_jacDot", _p, _p, _p, _p, _i)
"""Time derivative of a Jacobian (model, data, (3, nv) and (3, nv) to fill, (3,) point,
body)."""
