"""Who sits where, world by world."""

import numpy as np

import marl_airhockey as ah
from marl_airhockey.registry import make_driver
from marl_airhockey.sim.world.roster import Roster


def test_a_roster_plays_as_drivers_inside_do():
    names = ["striker", "goalkeeper"]
    inside = dict(zip(("paddle_0", "paddle_1"), names, strict=True))
    one = ah.make_world("duel", 6, backend="numba", drivers=inside)
    two = ah.make_world("duel", 6, backend="numba")
    roster = Roster(two)
    for name in names:
        roster.add(name, make_driver(name))
    roster.seated[:] = [0, 1]
    one.autoreset = two.autoreset = False
    one.reset(3)
    two.reset(3)
    roster.begin(np.arange(6))
    actions = np.zeros((6, 2, 2))
    for _ in range(80):
        roster.ask(actions)
        one.step(np.zeros((6, 0, 2)))
        two.step(actions)
    np.testing.assert_allclose(one.state.position, two.state.position, atol=1e-12)


class Watching(type(make_driver("random"))):
    """Driver that keeps the observations it is given."""

    def act(self, view, memory):
        self.seen.append(view.observation.copy())
        return super().act(view, memory)


def test_a_driver_observes_what_an_agent_at_its_seat_does():
    open_world = ah.make_world("duel", 3)
    expected = [open_world.reset(5)]
    driver = Watching()
    driver.seen = []
    world = ah.make_world("duel", 3, drivers={"paddle_1": driver})
    world.reset(5)
    for _ in range(20):
        world.step(np.full((3, 1, 2), 0.4))
        actions = np.stack([np.full((3, 2), 0.4), world.action[:, 1]], 1)
        expected.append(open_world.step(actions).observation)
    np.testing.assert_allclose(driver.seen, np.array(expected)[:-1, :, 1], atol=1e-6)


def test_who_sits_where_differs_by_world():
    world = ah.make_world("duel", 4, backend="numba")
    roster = Roster(world)
    still, random = (roster.add(n, make_driver(n)) for n in ("still", "random"))
    roster.seated[:] = [[still, random], [random, still], [-1, random], [-1, -1]]
    world.reset(0)
    roster.begin(np.arange(4))
    actions = np.full((4, 2, 2), 9.0)
    roster.ask(actions)
    assert not actions[[0, 1], [0, 1]].any()
    assert (actions[[2, 3, 3], [0, 0, 1]] == 9.0).all()
    action = actions[[0, 1, 2], [1, 0, 1]]
    assert (np.abs(action) <= 1).all()
    assert len(np.unique(action)) == 6
