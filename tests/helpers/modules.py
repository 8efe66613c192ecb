"""Modules of the page for Node, which takes them only from a package of modules."""

import shutil

from marl_airhockey.play.server import WEB


def modules(folder):
    """Return a copy of the modules of the page, in a folder."""
    copy = folder / "web"
    if not copy.exists():
        shutil.copytree(WEB, copy)
        (copy / "package.json").write_text('{"type": "module"}')
    return copy
