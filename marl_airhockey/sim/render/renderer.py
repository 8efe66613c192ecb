"""Renderer of one world: images with trails of the pucks, or a window."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from marl_airhockey.sim.core.errors import unknown_name
from marl_airhockey.sim.render.picture import WIDTH, Frame, draw
from marl_airhockey.sim.world.world import World
from marl_airhockey.types import Array

if TYPE_CHECKING:
    from marl_airhockey.sim.render.window import Window

TOP = "top"
"""Name of the 2D view from above, which every backend supports."""


class Renderer:
    """Renderer of one world of a batch, with a window if ``mode`` is "human".

    Args:
        world: Worlds, which are not changed.
        mode: Render mode, "rgb_array" or "human".
        title: Text at the left of the title bar.
        index: Index of the rendered world.
        viewpoint: Camera, `TOP` or one of the backend's viewpoints.

    Raises:
        ValueError: The mode or the viewpoint is unknown; the message lists all names.
    """

    MODES = ("rgb_array", "human")
    TRAIL = 24
    """Length of the longest trail of a puck, control steps."""

    def __init__(
        self, world: World, mode: str, title: str, index: int = 0, viewpoint: str = TOP
    ) -> None:
        if mode not in self.MODES:
            raise ValueError(unknown_name("render_mode", mode, self.MODES))
        viewpoints = (TOP, *world.backend.viewpoints)
        if viewpoint not in viewpoints:
            raise ValueError(unknown_name("viewpoint", viewpoint, viewpoints))
        self.world, self.mode, self.title = world, mode, title
        self.index, self.viewpoint = index, viewpoint
        self._window: Window | None = None
        self.begin()

    def __getstate__(self) -> dict[str, Any]:
        """Return the attributes without the window; a copy opens its own window."""
        return {**vars(self), "_window": None}

    def begin(self) -> None:
        """Clear the trails when an episode begins."""
        pucks = range(self.world.scene.pucks)
        self._trails: list[list[tuple[float, float]]] = [[] for _ in pucks]

    def follow(self) -> None:
        """Extend the trails after a reset or a step; in human mode, show an image."""
        pucks = self.world.state.puck[self.index]
        for trail, puck in zip(self._trails, pucks, strict=True):
            trail.append((float(puck[0]), float(puck[1])))
            del trail[: -self.TRAIL]
        if self.mode == "human":
            self.show()

    def frame(self) -> Frame:
        """Return the contents of an image of the current state."""
        world, i = self.world, self.index
        state = world.state.map(lambda x: x[i])
        memory = {name: value[i] for name, value in world.memory.items()}
        episode, eliminated = world.episode, world.scenario.eliminated(memory)
        note = f"{world.scenario.caption(memory)}   {float(state.time):4.1f} s"
        if len(world.scene.seats) == 1:
            note += f"   return {episode.returns[i, 0]:+.2f}"
        return Frame(
            scene=world.scene,
            state=state,
            marks=world.scenario.shown_marks(state, memory),
            trails=self._trails,
            title=self.title,
            note=note,
            clock=episode.cycles[i] / world.limits[i],
            success=bool(episode.success[i].any()),
            eliminated=() if eliminated is None else eliminated.tolist(),
        )

    def take_picture(self, width: int = WIDTH) -> Array:
        """Return an image (H, W, 3) uint8 RGB of the current state; width in pixels."""
        frame = self.frame()
        if self.viewpoint == TOP:
            return draw(frame, width)
        backend = self.world.backend
        return backend.photograph(self.index, self.viewpoint, frame.marks, width)

    def show(self) -> Array | None:
        """Return the image; in human mode, show it in the window and return None.

        Raises:
            RuntimeError: No episode has begun.
        """
        if not self.world.episode.number[self.index]:
            raise RuntimeError("render: no episode has begun; call reset() first")
        picture = self.take_picture()
        if self.mode == "rgb_array":
            return picture
        if self._window is None:
            from marl_airhockey.sim.render.window import Window

            rate = 1 / self.world.control_dt
            self._window = Window(picture.shape[1], picture.shape[0], rate)
        self._window.show(picture)
        return None

    def close(self) -> None:
        """Close the window, if there is one."""
        if self._window is not None:
            self._window.close()
            self._window = None
