"""Touches and lifts, step by step, on states made by hand."""

from dataclasses import replace
from itertools import pairwise

import numpy as np

import marl_airhockey as ah
from marl_airhockey.sim.contracts.scenario import Transition
from marl_airhockey.sim.core.touches import TOUCH_GAP, count_touches, no_touches
from marl_airhockey.toolkit.rewards import lifts, no_lifts

DT = 0.05
SCENE = ah.make_scenario("juggle").scene


def state(time, touched=0, at=np.nan, touching=False, x=0.0, vx=0.0):
    rest = SCENE.still_state(1)
    rest.puck[:, 0], rest.puck_velocity[:, 0] = (x, 0.0), (vx, 0.0)
    pair = (1, 1, 1)
    return replace(
        rest,
        time=np.full(1, time),
        touched=np.full(pair, touched),
        touched_at=np.full(pair, at),
        touching=np.full(pair, touching),
    )


def count(*after):
    """The memory after some steps, each from the one before."""
    states = [state(0.0), *after]
    memory = no_touches(states[0])
    for before, now in pairwise(states):
        memory = memory | count_touches(memory, before, now)
    return memory


def test_a_touch_counts_once():
    memory = count(state(DT, 1, 0.02), state(2 * DT))
    assert memory["touches"].item() == 1
    assert memory["any_touch"].item()
    assert memory["apart"].item() == 2 * DT - 0.02


def test_touches_right_after_each_other_are_one():
    soon, late = TOUCH_GAP - 0.02, TOUCH_GAP + 0.02
    for gap, touches in ((soon, 1), (late, 2)):
        whole, rest = divmod(gap, DT)
        between = [state(k * DT) for k in range(2, 2 + int(whole))]
        again = state((2 + whole) * DT, 1, rest)
        assert count(state(DT, 1, DT), *between, again)["touches"].item() == touches


def test_a_cradled_puck_is_touched_once_for_as_long_as_it_lies():
    steps = [state(DT, 1, 0.01, True)]
    steps += [state((k + 2) * DT, 1, 0.02, True) for k in range(20)]
    memory = count(*steps)
    assert memory["touches"].item() == 1
    assert memory["apart"].item() == 0.0


def test_contacts_at_the_start_are_no_touches():
    begun = state(0.0, touching=True)
    memory = no_touches(begun)
    assert memory["apart"].item() == 0.0
    assert count_touches(memory, begun, state(DT, 1, 0.01))["touches"].item() == 0


def test_a_hit_counts_when_the_puck_has_risen_by_the_lift():
    memory = no_lifts(state(0.0))
    heights, paid = [-0.5, -0.4, -0.31, -0.29, -0.1], []
    before = state(0.0, x=-0.5)
    for k, x in enumerate(heights, start=1):
        hit = k == 1
        after = state(k * DT, int(hit), 0.0 if hit else np.nan, x=x)
        old = memory
        t = Transition(before, np.zeros((1, 1, 2)), after, old, old, np.zeros(1, bool))
        memory, risen = lifts(t, 0.2)
        paid.append(bool(risen.any()))
        before = after
    assert paid == [False, False, False, True, False]


def test_a_carried_puck_never_rises():
    memory = no_lifts(state(0.0))
    before = state(0.0, x=-0.5, touching=True)
    for k in range(1, 12):
        after = state(k * DT, 0, np.nan, True, x=-0.5 + 0.03 * k)
        t = Transition(before, None, after, memory, memory, None)
        memory, risen = lifts(t, 0.2)
        assert not risen.any()
        before = after
    assert memory["struck_at"].item() == before.puck[0, 0, 0]
