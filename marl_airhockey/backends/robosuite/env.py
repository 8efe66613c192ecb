"""Air hockey as a robosuite environment: one UR5e a seat, each with the contact law."""

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

from marl_airhockey.backends.robosuite.controller import SeatController
from marl_airhockey.backends.robosuite.frames import TableFrame
from marl_airhockey.backends.robosuite.inverse_kinematics import reach_for
from marl_airhockey.backends.robosuite.models import AirHockeyArena
from marl_airhockey.backends.robosuite.table_physics import Surface
from marl_airhockey.core.scene import Scene
from marl_airhockey.core.seat import make_seat
from marl_airhockey.core.table import TABLES
from marl_airhockey.types import Array

ARM = "UR5e"


class TableController(OperationalSpaceController):
    """Robosuite's arm controller with `law.torques` as its law.

    An action is the wanted velocity in the plane, as a share of the seat's top speed,
    in the seat's ego frame; it passes the shared limits.
    """

    def __init__(self, *args: Any, hand: SeatController, **rest: Any) -> None:
        super().__init__(*args, **rest)
        self.hand = hand
        self.control_dim = 2
        self.input_min, self.input_max = -np.ones(2), np.ones(2)

    def bind(self) -> None:
        """Take the arrays of the simulation as it is now."""
        model, data = self.sim.model._model, self.sim.data._data
        site = self.sim.model.site_name2id(self.ref_name)
        low, high = self.actuator_min, self.actuator_max
        self.hand.bind(model, data, site, self.qvel_index, low, high)

    def set_goal(self, action: Array) -> None:
        self.hand.ask(np.asarray(action, dtype=float))

    def reset_goal(self, goal_update_mode: str = "achieved") -> None:
        self.bind()
        self.hand.rest()

    def run_controller(self) -> Array:
        self.torques = self.hand.torques()
        self.new_update = True
        return np.asarray(self.torques)

    @property
    def control_limits(self) -> tuple[Array, Array]:
        return self.input_min, self.input_max


@register_composite_controller
class AirHockeyController(CompositeController):
    """Arms get a `TableController`, other parts what robosuite gives them."""

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
    """One robot seat at home and a puck, on the standard table."""
    table = TABLES["standard"]
    return Scene(table, (make_seat("robot", table, 0),), pucks=1)


class AirHockey(ManipulationEnv):
    """``robosuite.make("AirHockey", robots="UR5e")``: a table, arms, pucks, blocks.

    Args:
        robots: one name for each seat of the scene.
        scene: who and what is on the table; one seat and a puck unless given.
        timestep: s of a physics step.
        control_freq: control steps a second.
        rest: of robosuite's environments.
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
                f"robots: {robots!r}; {len(self.scene.seats)} seats are played "
                f"by as many {ARM}"
            )
        self.place = TableFrame(self.scene.defaults.get("tilt", 0.0))
        period = 1 / control_freq
        count = len(self.scene.seats)
        self.hands = [
            SeatController(self.scene, self.place, i, period) for i in range(count)
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
        self.surface: Surface | None = None
        self._ready: list[Array | None] = [None] * count
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
        """Any number of arms."""

    def _load_model(self) -> None:
        super()._load_model()
        for i, robot in enumerate(self.robots):
            position, heading = self.place.base(self.scene, i)
            robot.robot_model.set_base_xpos(position)
            robot.robot_model.set_base_ori([0, 0, heading])
        arena = AirHockeyArena(self.scene, self.place)
        arena.set_origin([0, 0, 0])
        self.model = ManipulationTask(
            mujoco_arena=arena,
            mujoco_robots=[robot.robot_model for robot in self.robots],
        )

    def _initialize_sim(self, xml_string: str | None = None) -> None:
        super()._initialize_sim(xml_string)
        _set_up(self.sim.model._model)

    def lean_model(self) -> Any:
        """The same MuJoCo model without what is only to be seen: 2 MB instead of 34."""
        spec = mujoco.MjSpec.from_string(self.model.get_xml())
        spec.compiler.discardvisual = True
        # Room for contacts as they are needed, not for thousands in every world.
        spec.nconmax = spec.njmax = -1
        model = spec.compile()
        model.opt.timestep = self.sim.model._model.opt.timestep
        _set_up(model)
        return model

    def _setup_references(self) -> None:
        super()._setup_references()
        model, data = self.sim.model._model, self.sim.data._data
        self.surface = Surface(self.scene, self.place, model, data)
        for i, robot in enumerate(self.robots):
            if self._ready[i] is None:
                self._ready[i] = reach_for(
                    model,
                    data,
                    robot.eef_site_id["right"],
                    robot._ref_joint_pos_indexes,
                    robot._ref_joint_vel_indexes,
                    self.place.to_world(*self.hands[i].home),
                    self.hands[i].grip,
                )
            robot.init_qpos = self._ready[i]

    def _pre_action(self, action: Array, policy_step: bool = False) -> None:
        super()._pre_action(action, policy_step)
        assert self.surface is not None
        self.surface.act()

    def _setup_observables(self) -> Any:
        return {}

    def reward(self, action: Array | None = None) -> float:
        """Scenarios have the rewards."""
        return 0.0

    def _check_success(self) -> bool:
        return False


def _set_up(model: Any) -> None:
    """What robosuite's models have otherwise: air, and links that touch."""
    # A puck would slow down in air.
    model.opt.density = model.opt.viscosity = 0.0
    for k in range(model.ngeom):
        if model.geom(k).name.startswith(("robot", "mount", "fixed_mount")):
            # Only the paddle touches anything: links pass through what is there.
            model.geom_contype[k] = model.geom_conaffinity[k] = 0
