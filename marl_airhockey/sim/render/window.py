"""Window of render_mode="human", which uses pygame-ce."""

from __future__ import annotations

from marl_airhockey.sim.core.errors import require
from marl_airhockey.types import Array


class Window:
    """Window that shows images in real time.

    Args:
        width: Width of the window, pixels.
        height: Height of the window, pixels.
        rate: Number of images per second.

    Raises:
        RuntimeError: pygame-ce is not installed.
    """

    def __init__(self, width: int, height: int, rate: float) -> None:
        require("pygame", "play")
        import pygame

        self._pygame, self._rate = pygame, rate
        pygame.display.init()
        pygame.display.set_caption("marl_airhockey")
        self._screen = pygame.display.set_mode((width, height))
        self._clock = pygame.time.Clock()

    def show(self, picture: Array) -> None:
        """Show an image (H, W, 3) uint8, and wait until the next one is due."""
        pygame = self._pygame
        pygame.event.pump()
        surface = pygame.surfarray.make_surface(picture.swapaxes(0, 1))
        self._screen.blit(surface, (0, 0))
        pygame.display.flip()
        self._clock.tick(self._rate)

    def close(self) -> None:
        """Close the window."""
        self._pygame.display.quit()
