"""Air hockey for robot learning and multi-agent reinforcement learning."""

import sys as _sys
from pathlib import Path as _Path

import lazy_loader as _lazy_loader

_here = _Path(__file__).parent
if not (_here / "scenarios").is_dir():
    # In a checkout, scenarios/ and drivers/ are next to this package; in a wheel, in
    # it.
    __path__.append(str(_here.parent))

# __init__.pyi lists the public names. Each is imported when it is first used.
__getattr__, __dir__, __all__ = _lazy_loader.attach_stub(__name__, __file__)

from marl_airhockey import game_modules as _game_modules  # noqa: E402
from marl_airhockey.envs import registration as _registration  # noqa: E402

_registration.register_all()
_sys.meta_path.append(_game_modules.GameFinder())

__version__ = "0.1.0"
