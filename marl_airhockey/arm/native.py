"""MuJoCo's own functions, called from compiled code by their addresses."""

from __future__ import annotations

import ctypes
from pathlib import Path
from typing import Any

import mujoco

_library = ctypes.CDLL(
    str(next(iter(sorted(Path(mujoco.__file__).parent.glob("*mujoco*.[sd]*")))))
)


def _function(name: str, *arguments: Any) -> Any:
    kind = ctypes.CFUNCTYPE(None, ctypes.c_void_p, *arguments)
    address = ctypes.cast(getattr(_library, name), ctypes.c_void_p).value
    assert address is not None
    return kind(address)


_p, _i = ctypes.c_void_p, ctypes.c_int
step1 = _function("mj_step1", _p)
"""Model, data: all that follows from positions and velocities."""
step2 = _function("mj_step2", _p)
"""Model, data: forces, accelerations, the step itself."""
full_mass = _function("mj_fullM", _p, _p)
"""Model, (nv, nv) to fill, data's qM."""
site_jacobian = _function("mj_jacSite", _p, _p, _p, _i)
"""Model, data, (3, nv) and (3, nv) to fill, site."""
jacobian_rate = _function("mj_jacDot", _p, _p, _p, _p, _i)
"""Model, data, (3, nv) and (3, nv) to fill, (3,) point, body."""
