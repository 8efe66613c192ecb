"""Robosuite environment of air hockey: `osc` controls one UR5e for each seat."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np
import robosuite.macros as macros
from robosuite.controllers.composite.composite_controller import (
    CompositeController,
    register_composite_controller,
)
from robosuite.controllers.parts.arm.osc import OperationalSpaceController
from robosuite.controllers.parts.controller_factory import controller_factory
from robosuite.environments.manipulation.manipulation_env import ManipulationEnv
from robosuite.models.tasks import ManipulationTask

from marl_airhockey.sim.backends.robosuite.controller import SeatController
from marl_airhockey.sim.backends.robosuite.frames import TableFrame
from marl_airhockey.sim.backends.robosuite.inverse_kinematics import find_joint_angles
from marl_airhockey.sim.backends.robosuite.models import AirHockeyArena
from marl_airhockey.sim.backends.robosuite.table_physics import TablePhysics
from marl_airhockey.sim.core.scene import Scene
from marl_airhockey.sim.core.seat import make_seat
from marl_airhockey.sim.core.table import TABLES
from marl_airhockey.types import Array

ARM = "UR5e"
"""Name of the arm in robosuite."""


class TableController(OperationalSpaceController):
    """Arm controller of robosuite with the torques of `osc.torques`.

    An action is the target velocity in the plane, divided by the top speed of the seat,
    in its ego frame. The limits of `core.limits` apply.
    """

    def __init__(self, *args: Any, hand: SeatController, **rest: Any) -> None:
        super().__init__(*args, **rest)
        self.hand = hand
        self.control_dim = 2
        self.input_min, self.input_max = -np.ones(2), np.ones(2)

    def bind(self) -> None:
        """Set the arrays of the current simulation."""
        model, data = self.sim.model._model, self.sim.data._data
        site = self.sim.model.site_name2id(self.ref_name)
        low, high = self.actuator_min, self.actuator_max
        self.hand.bind(model, data, site, self.qvel_index, low, high)

    def set_goal(self, action: Array) -> None:
        self.hand.set_action(np.asarray(action, dtype=float))

    def reset_goal(self, goal_update_mode: str = "achieved") -> None:
        self.bind()
        self.hand.hold()

    def run_controller(self) -> Array:
        self.torques = self.hand.torques()
        self.new_update = True
        return np.asarray(self.torques)

    @property
    def control_limits(self) -> tuple[Array, Array]:
        return self.input_min, self.input_max


@register_composite_controller
class AirHockeyController(CompositeController):
    """Controller of a robot: `TableController` for arms, robosuite's for the rest."""

    name = "AIR_HOCKEY"

    def _init_controllers(self) -> None:
        for part, params in self.part_controller_config.items():
            if part in self.arms:
                hand = params.pop("hand")
                self.part_controllers[part] = TableController(
                    interpolator_pos=None, interpolator_ori=None, hand=hand, **params
                )
                params["hand"] = hand
            else:
                self.part_controllers[part] = controller_factory(
                    part, params["type"], params
                )


def default_scene() -> Scene:
    """Return the standard table with a robot seat at the home end and a puck."""
    table = TABLES["standard"]
    return Scene(table, (make_seat("robot", table, 0),), pucks=1)


class AirHockey(ManipulationEnv):
    """Environment of ``robosuite.make("AirHockey", robots="UR5e")``.

    Args:
        robots: Name of the robot of each seat of the scene, or one name for all seats.
        scene: Scene on the table; None for `default_scene`.
        timestep: Length of a physics step, s.
        control_freq: Number of control steps per second.
        rest: Other arguments of robosuite's environments.

    Raises:
        ValueError: The robots are not one UR5e for each seat.
    """

    def __init__(
        self,
        robots: str | list[str] = ARM,
        scene: Scene | None = None,
        timestep: float = 0.001,
        control_freq: float = 20,
        **rest: Any,
    ) -> None:
        self.scene = scene if scene is not None else default_scene()
        names = [robots] * len(self.scene.seats) if isinstance(robots, str) else robots
        if list(names) != [ARM] * len(self.scene.seats):
            raise ValueError(
                f"robots: {robots!r}; the {len(self.scene.seats)} seats must be played "
                f"by as many {ARM}"
            )
        self.frame = TableFrame(self.scene.defaults.get("tilt", 0.0))
        period = 1 / control_freq
        count = len(self.scene.seats)
        self.hands = [
            SeatController(self.scene, self.frame, i, period) for i in range(count)
        ]
        macros.SIMULATION_TIMESTEP = timestep
        configs = [
            {
                "type": AirHockeyController.name,
                "body_parts": {
                    "right": {
                        "type": "OSC_POSE",
                        "input_max": 1,
                        "input_min": -1,
                        "output_max": 1,
                        "output_min": -1,
                        "kp": 150,
                        "interpolation": None,
                        "hand": hand,
                        "gripper": {"type": "GRIP"},
                    }
                },
            }
            for hand in self.hands
        ]
        usual = {
            "has_renderer": False,
            "has_offscreen_renderer": False,
            "use_camera_obs": False,
            "hard_reset": False,
            "horizon": 10**9,
            "ignore_done": True,
        }
        self.table_physics: TablePhysics | None = None
        self._home_angles: list[Array | None] = [None] * count
        super().__init__(
            robots=list(names),
            controller_configs=configs,
            gripper_types="AirHockeyPaddle",
            base_types="NullMount",
            initialization_noise=None,
            control_freq=control_freq,
            **{**usual, **rest},
        )

    def _check_robot_configuration(self, robots: Any) -> None:
        """Accept any number of arms."""

    def _load_model(self) -> None:
        super()._load_model()
        for i, robot in enumerate(self.robots):
            position, heading = self.frame.base(self.scene, i)
            robot.robot_model.set_base_xpos(position)
            robot.robot_model.set_base_ori([0, 0, heading])
        arena = AirHockeyArena(self.scene, self.frame)
        arena.set_origin([0, 0, 0])
        self.model = ManipulationTask(
            mujoco_arena=arena,
            mujoco_robots=[robot.robot_model for robot in self.robots],
        )

    def _initialize_sim(self, xml_string: str | None = None) -> None:
        super()._initialize_sim(xml_string)
        _disable_air_and_links(self.sim.model._model)

    def physics_model(self) -> Any:
        """Return the MuJoCo model without its visuals, with 2 MB instead of 34 MB."""
        spec = mujoco.MjSpec.from_string(self.model.get_xml())
        spec.compiler.discardvisual = True
        # Allocate memory for contacts on demand, not for thousands per world.
        spec.nconmax = spec.njmax = -1
        model = spec.compile()
        model.opt.timestep = self.sim.model._model.opt.timestep
        _disable_air_and_links(model)
        return model

    def _setup_references(self) -> None:
        super()._setup_references()
        model, data = self.sim.model._model, self.sim.data._data
        self.table_physics = TablePhysics(self.scene, self.frame, model, data)
        for i, robot in enumerate(self.robots):
            if self._home_angles[i] is None:
                self._home_angles[i] = find_joint_angles(
                    model,
                    data,
                    robot.eef_site_id["right"],
                    robot._ref_joint_pos_indexes,
                    robot._ref_joint_vel_indexes,
                    self.frame.to_world(*self.hands[i].home),
                    self.hands[i].foot_rotation,
                )
            robot.init_qpos = self._home_angles[i]

    def _pre_action(self, action: Array, policy_step: bool = False) -> None:
        super()._pre_action(action, policy_step)
        assert self.table_physics is not None
        hands = [(*h.position[:2], *h.velocity[:2]) for h in self.hands]
        self.table_physics.apply_laws(np.array(hands))

    def _setup_observables(self) -> Any:
        return {}

    def reward(self, action: Array | None = None) -> float:
        """Return 0, because scenarios compute the rewards."""
        return 0.0

    def _check_success(self) -> bool:
        return False


def _disable_air_and_links(model: Any) -> None:
    """Disable the air and the contacts of links in robosuite's models."""
    # Air would slow pucks down.
    model.opt.density = model.opt.viscosity = 0.0
    for k in range(model.ngeom):
        if model.geom(k).name.startswith(("robot", "mount", "fixed_mount")):
            # Only the paddle has contacts; links pass through all bodies.
            model.geom_contype[k] = model.geom_conaffinity[k] = 0
