"""Images of the worlds of a batch, for vector environments."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

from marl_airhockey.sim.core.errors import unknown_name
from marl_airhockey.sim.world.world import World
from marl_airhockey.types import Array

if TYPE_CHECKING:
    from marl_airhockey.sim.render.renderer import Renderer


class Pictures:
    """Renderers of all worlds of a batch, or none.

    Args:
        world: Worlds of the images, which are not changed.
        render_mode: "rgb_array", or None for no renderers.

    Raises:
        ValueError: The mode is unknown.
    """

    def __init__(self, world: World, render_mode: str | None) -> None:
        self._renderers: list[Renderer] = []
        if render_mode is None:
            return
        if render_mode != "rgb_array":
            what = "render_mode of a batch"
            raise ValueError(unknown_name(what, render_mode, (None, "rgb_array")))
        from marl_airhockey.sim.render.renderer import Renderer

        title = world.scenario.name.replace("_", " ")
        mode, rows = render_mode, range(world.num_worlds)
        self._renderers = [Renderer(world, mode, title, index=i) for i in rows]

    def follow(self, begun: Iterable[int] = ()) -> None:
        """Extend all trails after a reset or a step; clear those of begun worlds."""
        if not self._renderers:
            return
        for i in begun:
            self._renderers[i].begin()
        for renderer in self._renderers:
            renderer.follow()

    def take(self) -> list[Array]:
        """Return an image (H, W, 3) uint8 of each world.

        Raises:
            RuntimeError: There is no render mode, or `reset` was not called.
        """
        if not self._renderers:
            raise RuntimeError('render: create it with render_mode="rgb_array"')
        return [picture for r in self._renderers if (picture := r.show()) is not None]
