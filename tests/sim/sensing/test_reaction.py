"""Views that are late by the reaction of a game, against what was there then."""

import copy

import numpy as np
import pytest

import marl_airhockey as ah
from marl_airhockey.sim.contracts.driver import Driver
from marl_airhockey.sim.sensing.reaction import ReactionDelay

STEPS = 3
"""Control steps in a reaction of 0.15 s at 20 Hz"""


def make(reaction=0.15, worlds=4, scenario="duel", **keywords):
    options = {"reaction": reaction, **keywords.pop("options", {})}
    return ah.make_world(scenario, worlds, options=options, **keywords)


def play(world, steps, seed=0):
    """Return observations from the first on, under random actions."""
    rng = np.random.default_rng(seed)
    shape = world.num_worlds, len(world.open), 2
    shown = [world.reset(seed)]
    return shown + [
        world.step(rng.uniform(-1.0, 1.0, shape)).observation for _ in range(steps)
    ]


def part(world, shown, label):
    return shown[..., list(world.observer.labels).index(label)]


def test_pucks_and_others_are_late_and_the_own_paddle_is_not():
    world, prompt = make(), make(0.0)
    shown, direct = play(world, 40), play(prompt, 40)
    np.testing.assert_array_equal(world.state.position, prompt.state.position)
    for k, seen in enumerate(shown):
        now, then = direct[k], direct[max(k - STEPS, 0)]
        for i, label in enumerate(world.observer.labels):
            if label.startswith("own.delayed."):
                wanted = part(prompt, then, label.replace(".delayed", ""))
            elif label.startswith("own."):
                wanted = part(prompt, now, label)
            elif label.startswith("own_to_puck_0.d"):
                puck = part(world, seen, f"puck_0.predicted.{label[-1]}")
                wanted = puck - part(prompt, now, f"own.{label[-1]}")
            elif ".predicted." in label:
                continue  # see test_extrapolation
            else:
                wanted = part(prompt, then, label)
            np.testing.assert_allclose(seen[..., i], wanted, atol=1e-6, err_msg=label)


@pytest.mark.parametrize("observe", ["velocity", "estimate", "history"])
def test_every_form_is_late_in_a_profile_that_senses(observe):
    keywords = {"profile": "ur5e", "observe": observe, "options": {"seats": "robot"}}
    world, prompt = make(**keywords), make(0.0, **copy.deepcopy(keywords))
    shown, direct = play(world, 20), play(prompt, 20)
    labels = world.observer.labels
    seen_late = [n for n in labels if n.startswith(("puck_0", "other_0"))]
    assert ("puck_0.predicted.x" in seen_late) == (observe != "history")
    seen_late = [name for name in seen_late if ".predicted." not in name]
    assert len(seen_late) > 6
    for name in seen_late:
        for k in range(STEPS, 21):
            then = part(prompt, direct[k - STEPS], name)
            np.testing.assert_array_equal(part(world, shown[k], name), then)


def test_pictures_are_late():
    world, prompt = make(worlds=1, observe="pixels"), make(0.0, 1, observe="pixels")
    shown, direct = play(world, 6), play(prompt, 6)
    np.testing.assert_array_equal(shown[6], direct[3])
    assert (shown[6] != direct[6]).any()


def test_an_episode_begins_with_what_is_there():
    world = make(scenario="duel", max_cycles=4)
    play(world, 3)
    result = world.step(np.zeros((4, 2, 2)))
    assert result.truncated.all()
    state = world.state
    shown = part(world, result.observation, "puck_0.vx")
    np.testing.assert_allclose(shown[:, 0], state.puck_velocity[:, 0, 0], atol=1e-6)
    np.testing.assert_allclose(shown[:, 1], -state.puck_velocity[:, 0, 0], atol=1e-6)


class Watcher(Driver):
    """Driver that keeps what it is shown."""

    def __init__(self):
        self.views = []

    def act(self, view, memory):
        self.views.append((view.state.map(np.copy), view.reaction))
        return 0.0 * view.state.paddle[:, view.seat] + 0.5, memory


def test_drivers_see_late_but_for_their_own_paddle():
    watcher = Watcher()
    world = make(drivers={"paddle_1": watcher})
    rng, truth = np.random.default_rng(0), []
    world.reset(0)
    for _ in range(20):
        truth.append(world.state)
        world.step(rng.uniform(-1.0, 1.0, (4, 1, 2)))
    for k, (seen, reaction) in enumerate(watcher.views):
        # The far seat's ego frame is turned by half a turn.
        then, now = truth[max(k - STEPS, 0)], truth[k]
        np.testing.assert_allclose(-seen.puck, then.puck, atol=1e-12)
        np.testing.assert_allclose(-seen.paddle[:, 0], then.paddle[:, 0], atol=1e-12)
        np.testing.assert_allclose(-seen.paddle[:, 1], now.paddle[:, 1], atol=1e-12)
        assert reaction == pytest.approx(0.15)


def test_rows_see_as_single_worlds_do_and_copies_go_on():
    many, one = make(worlds=5), make(worlds=1)
    many.reset([7, 8, 9, 10, 11])
    one.reset([9])
    rng = np.random.default_rng(0)
    for k in range(200):
        action = rng.uniform(-1.0, 1.0, (5, 2, 2))
        a, b = many.step(action), one.step(action[2:3])
        np.testing.assert_array_equal(a.observation[2], b.observation[0])
        if k == 100:
            many = copy.deepcopy(many)


def test_goals_and_a_reaction_are_refused_together():
    with pytest.raises(ValueError, match="reaction"):
        make(scenario="hit_goal", options={"goals": "dict"})


@pytest.mark.parametrize("name", ["juggle", "move_block", "free_for_all"])
def test_any_scenario_can_be_late(name):
    world = make(worlds=2, scenario=name)
    world.reset(0)
    for _ in range(5):
        result = world.step(np.zeros((2, len(world.open), 2)))
    assert result.observation.shape[-1] == len(world.observer.labels)
    assert np.isfinite(result.observation).all()


def test_bodies_that_moved_before_are_observed_where_they_were():
    delay, rows = ReactionDelay(STEPS, 0.05), np.array([1])
    names = ("state", "estimate")
    values = {n: np.full((2, 3, 2), k + 1.0) for k, n in enumerate(names)}
    parts = {n: {"position": 0.0 * v, "velocity": v} for n, v in values.items()}
    delay.begin(np.arange(2), parts)
    delay.push(parts)
    delay.begin(rows, parts)
    for step in range(STEPS + 1):
        for name, speed in zip(names, (1.0, 2.0), strict=True):
            seen = delay.delayed(name)["position"]
            np.testing.assert_allclose(seen[1], -0.05 * (STEPS - step) * speed)
        delay.push(parts)
