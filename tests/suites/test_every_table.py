"""What every table owes: each task's script plays on it, from starts in its reach."""

import numpy as np
import pytest
from names import seats

import marl_airhockey as ah
from marl_airhockey.evaluation.evaluate import evaluate
from marl_airhockey.sim.core.table import TABLES, Table

OTHERS = [name for name in TABLES if name != "standard"]
# Least success on `standard`, `full_size`, `ubc_pro` and `ubc_wood`. A puck that falls
# two metres on a table that is wider than an arm's reach is missed more often.
FLOORS = [
    ("reach", "reacher", (0.97, 0.97, 0.97, 0.97)),
    ("reach_velocity", "reacher", (0.95, 0.95, 0.95, 0.95)),
    ("reach_sequence", "reacher", (0.95, 0.95, 0.95, 0.95)),
    ("touch", "goalkeeper", (0.97, 0.97, 0.80, 0.88)),
    ("touch", "striker", (0.97, 0.97, 0.80, 0.88)),
    ("strike", "striker", (0.95, 0.88, 0.90, 0.92)),
    ("strike_crowd", "striker", (0.95, 0.93, 0.93, 0.95)),
    ("juggle", "striker", (0.95, 0.95, 0.38, 0.55)),
    ("puck_velocity", "striker", (0.95, 0.95, 0.75, 0.85)),
    # It aims without spin and rails, at a circle that is as small as the puck.
    ("hit_goal", "striker", (0.50, 0.38, 0.22, 0.38)),
    ("move_block", "striker", (0.70, 0.54, 0.28, 0.48)),
    ("rally", "allround", (0.50, 0.60, 0.85, 0.80)),
    ("team_juggle", "striker", (0.95, 0.90, 0.28, 0.60)),
]
OPTIONS = {"team_juggle": {"passes": 2}}
"""Options with which a script plays; in 30 s there is no time for many long flights"""


@pytest.mark.parametrize(("task", "script", "floors"), FLOORS)
@pytest.mark.parametrize("table", TABLES)
def test_a_script_is_an_honest_baseline(task, script, floors, table):
    keywords = {
        "options": {"table": table, **OPTIONS.get(task, {})},
        "drivers": {f"paddle_{i}": script for i in range(1, seats(task))},
    }
    found = evaluate(script, task, episodes=200, **keywords)
    assert found.success >= floors[list(TABLES).index(table)]
    low, high = found.success_interval
    assert low <= found.success <= high


@pytest.mark.parametrize("table", OTHERS)
def test_first_states_lie_on_the_table(scenario, table):
    """Bodies are apart and inside, and paddles in their reaches."""
    world = ah.make_world(scenario, 200, options={"table": table})
    world.reset(0)
    state, scene = world.state, world.scenario.scene
    radius = np.array(state.bodies.radius)
    gaps = state.position @ scene.table.normals.T + scene.table.offsets
    assert (gaps >= radius[:, None] - 1e-9).all()
    apart = np.linalg.norm(
        state.position[:, :, None] - state.position[:, None], axis=-1
    )
    apart += np.eye(len(radius)) * 9.0
    assert (apart >= radius[:, None] + radius - 1e-9).all()
    for k, (normals, offsets) in enumerate(
        zip(world.reach.normals, world.reach.offsets, strict=True)
    ):
        assert (state.paddle[:, k] @ normals.T + offsets >= -1e-9).all()


def test_what_an_arm_reaches_stays_in_its_reach():
    reach = np.array(TABLES["standard"].robot_reach)
    inside = reach.mean(0) + 0.9 * (reach - reach.mean(0))
    points = inside - (TABLES["standard"].size[0] / 2, 0.0)
    for table in TABLES.values():
        moved = table.from_standard(points).copy()
        edge = np.array(table.robot_reach)
        moved[:, 0] += table.size[0] / 2
        assert (moved.min(0) >= edge.min(0)).all()
        assert (moved.max(0) <= edge.max(0)).all()
    far = np.array([0.8382, 0.0])
    pro = TABLES["ubc_pro"].from_standard(far)
    np.testing.assert_allclose(pro, (1.181, 0.0), atol=1e-9)
    assert TABLES["standard"].from_standard(points) is points
    assert Table.rectangle(1.6764, 0.6096).from_standard(points) is points
