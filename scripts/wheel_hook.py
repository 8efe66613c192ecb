"""Hook of hatchling: sets the platform of a wheel that contains compiled code.

``make wheel`` compiles into ``build/precompiled``. Without this folder the wheel is
pure Python and compiles at the first start.
"""

from __future__ import annotations

import platform
import sys
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

CODE = "build/precompiled"


class CompiledCode(BuildHookInterface):  # type: ignore[misc] # hatchling is not installed
    """Build hook that adds compiled code to a wheel, if there is any."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Set the files and the tag of a wheel before it is written."""
        if version == "editable" or not (Path(self.root) / CODE).is_dir():
            return
        build_data["force_include"][CODE] = "marl_airhockey/precompiled"
        build_data["pure_python"] = False
        if sys.platform == "linux":
            # numba loads the code, and its own wheels need a newer glibc.
            python = f"cp{sys.version_info.major}{sys.version_info.minor}"
            system = f"manylinux_2_17_{platform.machine()}"
            build_data["tag"] = f"{python}-none-{system}"
        else:
            build_data["infer_tag"] = True
