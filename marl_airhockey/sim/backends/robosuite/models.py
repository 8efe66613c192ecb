"""Models for robosuite: table with pucks and blocks, and paddle as a gripper."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from robosuite.models.arenas import Arena
from robosuite.models.grippers import GripperModel, register_gripper
from robosuite.utils.mjcf_utils import (
    array_to_string,
    find_elements,
    new_body,
    new_geom,
    new_joint,
)

from marl_airhockey.sim.backends.robosuite.frames import TableFrame
from marl_airhockey.sim.contracts.palette import LIGHT, SEATS, rgb
from marl_airhockey.sim.core.scene import Scene
from marl_airhockey.types import Array

HERE = Path(__file__).parent
"""Folder of the XML files."""
SLIDES, RAIL, FOOT = 2, 8, 4
"""Contact bits of three groups: the paddle's side with pucks and blocks; pucks, blocks
and rails; the paddle's foot and the table."""
THICK = 0.06
"""Thickness of rails, m."""
TALL = 0.02
"""Half the height of rails, pucks and blocks, m."""
LOW = 0.004
"""Height at which pucks and round blocks touch, m. A higher contact would tilt the
paddle if a puck is caught between paddle and rail."""
STEP = 0.001
"""Difference in height between layers of one colour, m."""
RING, INNER = 0.8, 0.6
"""Radii of the bright ring on a puck, in radii of the puck."""


@register_gripper
class AirHockeyPaddle(GripperModel):
    """Round paddle in place of a gripper, without joints.

    Args:
        idn: Name of the arm, which begins with the number of its seat.
    """

    def __init__(self, idn: int | str = 0) -> None:
        super().__init__(str(HERE / "paddle.xml"), idn=idn)
        seat = int(str(idn).partition("_")[0])
        name = self.correct_naming("disc_visual")
        disc = find_elements(self.root, "geom", {"name": name}, return_first=True)
        disc.set("rgba", _rgba(SEATS[seat % len(SEATS)]))

    def format_action(self, action: Array) -> Array:
        return action

    @property
    def init_qpos(self) -> None:
        """Joint positions: None, because there are no joints."""
        return None


class AirHockeyArena(Arena):
    """Arena of a scene: a tilted table with rails, pucks, blocks and obstacles.

    Args:
        scene: Scene on the table.
        frame: Frame of the table.
    """

    def __init__(self, scene: Scene, frame: TableFrame) -> None:
        super().__init__(str(HERE / "arena.xml"))
        self.scene = scene
        self.table = new_body(
            "table",
            pos=array_to_string(frame.origin),
            quat=array_to_string(frame.quaternion),
        )
        self.worldbody.append(self.table)
        self._surface()
        for side in range(len(scene.table.vertices)):
            self._rail(side)
        for k, kind in enumerate([*["puck"] * scene.pucks, *["block"] * scene.blocks]):
            number = k - scene.pucks * (kind == "block")
            self._mover(
                f"{kind}{number}", kind, scene.bodies.radius[k + len(scene.seats)]
            )
        self._stands(frame)
        for k, obstacle in enumerate(scene.obstacles):
            self._obstacle(k, obstacle.start, obstacle.end, obstacle.radius)

    def _add(self, name: str, kind: str, **rest: str) -> None:
        self.table.append(new_geom(name, kind, **rest))

    def _surface(self) -> None:
        size = self.scene.table.size / 2 + THICK
        self._add(
            "surface_visual",
            "box",
            size=array_to_string([*size, 0.025]),
            pos="0 0 -.0251",
            material="field",
            **_visual(LIGHT["field"]),
        )
        self._add(
            "surface",
            "plane",
            size="2 2 .1",
            pos="0 0 0",
            condim="3",
            friction="0.05 0.005 0.0001",
            solref="0.05 1",
            **_collision(FOOT),
        )

    def _rail(self, side: int) -> None:
        """Add the rail of a side: a plane, or boxes next to its goal lines."""
        table, scene = self.scene.table, self.scene
        start, end = table.ends(side)
        along = (end - start) / np.linalg.norm(end - start)
        normal = table.normals[side]
        goal_lines = [
            m for m in scene.goal_lines if m.side == side and m.width is not None
        ]
        openings = [scene.opening(m) for m in goal_lines]
        posts = [start, *(p for opening in openings for p in opening), end]
        for opening in openings:
            self._goal(side, opening)
        for k in range(0, len(posts), 2):
            # Pieces end at posts and overlap at corners.
            a = posts[k] - along * THICK * (k == 0)
            b = posts[k + 1] + along * THICK * (k + 2 == len(posts))
            middle = (a + b) / 2 - normal * THICK / 2
            box = {
                "size": array_to_string(
                    [np.linalg.norm(b - a) / 2, THICK / 2, TALL],
                ),
                "pos": array_to_string([*middle, TALL]),
                "xyaxes": array_to_string([*along, 0, -along[1], along[0], 0]),
            }
            name = f"rail{side}_{k // 2}"
            # Equal heights would flicker where the rails of two sides overlap.
            seen = [np.linalg.norm(b - a) / 2, THICK / 2, TALL - 0.001 * (side % 2)]
            visual = {**box, "size": array_to_string(seen), **_visual(LIGHT["rail"])}
            self._add(f"{name}_visual", "box", **visual)
            if openings:
                self._add(name, "box", priority="3", **box, **_sliding(RAIL))
        if not openings:
            self._add(
                f"rail{side}_0",
                "plane",
                size="2 2 .1",
                pos=array_to_string([*start, 0]),
                xyaxes=array_to_string([*-along, 0, 0, 0, 1]),
                priority="3",
                **_sliding(RAIL),
            )

    def _goal(self, side: int, opening: Array) -> None:
        """Add a strip in the colour of its seat in an opening (2, 2), m, of a side."""
        sides = [seat.side for seat in self.scene.seats]
        owner = sides.index(side) if side in sides else 0
        along, normal = opening[1] - opening[0], self.scene.table.normals[side]
        middle = opening.mean(0) - normal * THICK / 2
        self._add(
            f"goal{side}_visual",
            "box",
            size=array_to_string([np.linalg.norm(along) / 2, THICK / 2, STEP]),
            pos=array_to_string([*middle, STEP]),
            xyaxes=array_to_string([*along, 0, -along[1], along[0], 0]),
            **_visual(SEATS[owner % len(SEATS)]),
        )

    def _mover(self, name: str, kind: str, radius: float) -> None:
        """Add a puck or a block, which moves and rotates in the plane of the table."""
        body = new_body(name, pos=f"0 0 {TALL}")
        for joint, axis in (("x", "1 0 0"), ("y", "0 1 0")):
            body.append(new_joint(name=f"{name}_{joint}", type="slide", axis=axis))
        body.append(new_joint(name=f"{name}_yaw", type="hinge", axis="0 0 1"))
        square = kind == "block" and self.scene.block_shape == "square"
        shape = "box" if square else "cylinder"
        size = [radius, radius, TALL] if square else [radius, TALL]
        layers = {"": (shape, size, LIGHT[kind])}
        if kind == "puck":
            inner = INNER * radius
            layers["_ring"] = "cylinder", [RING * radius, TALL + STEP], LIGHT["field"]
            layers["_top"] = "cylinder", [inner, TALL + 2 * STEP], LIGHT["puck"]
            # A stripe shows the spin.
            stripe = [inner, 0.2 * inner, TALL + 3 * STEP]
            layers["_stripe"] = "box", stripe, LIGHT["field"]
        for layer, (form, sizes, colour) in layers.items():
            body.append(
                new_geom(
                    f"{name}{layer}_visual",
                    form,
                    size=array_to_string(sizes),
                    mass="0",
                    **_visual(colour),
                )
            )
        body.append(
            new_geom(
                name,
                # Spheres at one height touch in one point, like discs in a plane.
                "box" if square else "sphere",
                pos=array_to_string([0, 0, LOW - TALL]),
                size=array_to_string([radius, radius, LOW] if square else [radius]),
                mass="0.03",
                priority="1" if kind == "block" else "0",
                **_sliding(SLIDES | RAIL),
            )
        )
        self.table.append(body)

    def _stands(self, frame: TableFrame) -> None:
        """Add legs of the table and pedestals of the arms, without contacts."""
        x, y = self.scene.table.size / 2 - 0.08
        for k, (i, j) in enumerate(((-x, -y), (-x, y), (x, -y), (x, y))):
            top = frame.to_world(float(i), float(j), -0.05)
            self._stand(f"leg{k}", "box", top, "0.025 0.025")
        for k in range(len(self.scene.seats)):
            base, _ = frame.base(self.scene, k)
            self._stand(f"pedestal{k}", "cylinder", base, "0.09")

    def _stand(self, name: str, kind: str, top: Array, size: str) -> None:
        x, y, z = top
        size, pos = f"{size} {z / 2}", array_to_string([x, y, z / 2])
        rest = {"size": size, "pos": pos, **_visual(LIGHT["rail"])}
        self.worldbody.append(new_geom(f"{name}_visual", kind, **rest))

    def _obstacle(
        self,
        k: int,
        start: tuple[float, float],
        end: tuple[float, float] | None,
        radius: float,
    ) -> None:
        name, visual = f"obstacle{k}", _visual(LIGHT["rail"])
        ends = [start] if end is None or end == start else [start, end]
        for i, point in enumerate(ends):
            post = {
                "size": array_to_string([radius, TALL]),
                "pos": array_to_string([*point, TALL]),
            }
            self._add(f"{name}_{i}_visual", "cylinder", **post, **visual)
        shape = post
        if len(ends) == 2:
            (ax, ay), (bx, by) = ends
            points = [ax, ay, TALL, bx, by, TALL]
            shape = {"size": f"{radius}", "fromto": array_to_string(points)}
            # The bar is a little lower than its ends, so that these cover it.
            long = np.hypot(bx - ax, by - ay)
            bar = {
                "size": array_to_string([long / 2, radius, 0.98 * TALL]),
                "pos": array_to_string([(ax + bx) / 2, (ay + by) / 2, TALL]),
                "xyaxes": array_to_string([bx - ax, by - ay, 0, ay - by, bx - ax, 0]),
            }
            self._add(f"{name}_visual", "box", **bar, **visual)
        self._add(name, "capsule", priority="3", **shape, **_sliding(SLIDES | RAIL))


def _rgba(colour: str) -> str:
    return str(array_to_string([*(value / 255 for value in rgb(colour)), 1.0]))


def _visual(colour: str) -> dict[str, str]:
    bits = {"contype": "0", "conaffinity": "0"}
    return {"group": "1", "rgba": _rgba(colour), **bits}


def _collision(bits: int) -> dict[str, str]:
    both = {"contype": str(bits), "conaffinity": str(bits)}
    return {"group": "0", "rgba": "0 0 0 0", **both}


def _sliding(bits: int) -> dict[str, str]:
    return {"condim": "1", **_collision(bits)}
