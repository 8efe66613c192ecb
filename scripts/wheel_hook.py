"""Hook of hatchling: a wheel that holds compiled code names the platform it is for.

``make wheel`` compiles into ``build/precompiled``. Without that folder the wheel is
pure Python, as before, and compiles at the first start.
"""

from __future__ import annotations

import platform
import sys
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

CODE = "build/precompiled"


class CompiledCode(BuildHookInterface):  # type: ignore[misc] # hatchling is not installed
    """Add compiled code to a wheel, if there is any."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Name the files and the tag; called before a wheel is written."""
        if version == "editable" or not (Path(self.root) / CODE).is_dir():
            return
        build_data["force_include"][CODE] = "marl_airhockey/precompiled"
        build_data["pure_python"] = False
        if sys.platform == "linux":
            # It is loaded by numba, whose own wheels need a newer glibc.
            python = f"cp{sys.version_info.major}{sys.version_info.minor}"
            system = f"manylinux_2_17_{platform.machine()}"
            build_data["tag"] = f"{python}-none-{system}"
        else:
            build_data["infer_tag"] = True
