"""Whatever lets a driver act shows it what an agent at its seat would observe."""

import numpy as np
import pytest

import marl_airhockey as ah
from marl_airhockey.evaluation import evaluate as evaluation
from marl_airhockey.play import match_drivers
from marl_airhockey.play.live_match import RATE, LiveMatch
from marl_airhockey.registry import make_driver
from marl_airhockey.sim.core.profiles import PROFILES
from marl_airhockey.sim.world.roster import Roster

STEPS = 60
SCENARIOS = "juggle", "team_juggle", "duel"


class Comparing(type(make_driver("striker"))):
    """Driver that compares what it is shown with what its world would observe."""

    world = None
    compared = 0

    def act(self, view, memory):
        if self.world is not None:  # A driver is tried before its world is known.
            expected = self.world.observe(np.array([view.seat]))[:, 0]
            shown = view.observation
            np.testing.assert_array_equal(shown, expected[: len(shown)])
            state, known = self.world.observer.known(
                self.world.known.sensed, self.world.known.memory
            )
            np.testing.assert_array_equal(view.state.time, state.time[: len(shown)])
            for name, value in view.scenario_memory.items():
                np.testing.assert_array_equal(value, known[name][: len(shown)], name)
            self.compared += 1
        return super().act(view, memory)


def inside(driver, scenario, keywords):
    driver.world = world = ah.make_world(
        scenario, 3, drivers={"paddle_0": driver}, **keywords
    )
    world.reset(1)
    for _ in range(STEPS):
        world.step(np.zeros((3, len(world.open), 2)))


def roster(driver, scenario, keywords):
    driver.world = world = ah.make_world(scenario, 3, **keywords)
    players = Roster(world)
    players.add("driver", driver)
    players.seated[:, 0] = 0
    world.reset(1)
    players.begin(np.arange(3))
    actions = np.zeros((3, len(world.scene.seats), 2))
    for _ in range(STEPS):
        players.ask(actions)
        result = world.step(actions)
        if (ended := np.flatnonzero(result.terminated | result.truncated)).size:
            players.begin(ended)


def page(driver, scenario, keywords):
    match = LiveMatch(scenario, {"paddle_0": "striker"}, keywords, seed=1)
    driver.world = match.world
    match.start()
    for _ in range(8 * RATE):
        match.tick()


def evaluated(driver, scenario, keywords):
    seats = len(ah.make_world(scenario).scene.seats)
    keywords["drivers"] = {f"paddle_{k}": "random" for k in range(1, seats)}
    ah.evaluate(driver, scenario, episodes=2, exact=True, max_cycles=STEPS, **keywords)


@pytest.mark.usefixtures("uncompiled")
@pytest.mark.parametrize("profile", sorted(PROFILES))
@pytest.mark.parametrize("name", SCENARIOS)
@pytest.mark.parametrize("caller", [inside, roster, page, evaluated])
def test_a_driver_observes_what_an_agent_would(caller, name, profile, monkeypatch):
    driver = Comparing()

    def made(player):
        return driver if player == "striker" else make_driver(player)

    def build(*args):
        driver.world = build_driven_world(*args)
        return driver.world

    build_driven_world = evaluation.build_driven_world
    monkeypatch.setattr(match_drivers, "make_driver", made)
    monkeypatch.setattr(evaluation, "build_driven_world", build)
    caller(driver, name, {"profile": profile})
    assert driver.compared > 20
