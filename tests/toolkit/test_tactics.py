"""Scripted players of games: how strong they are beside a person."""

from dataclasses import replace

import pytest

from marl_airhockey.evaluation.games import play_against
from marl_airhockey.registry import make_driver
from marl_airhockey.sim.contracts.driver import Driver

REACTION, NOISE = 0.2, 0.012
"""Reaction of a person, s, and how far it misjudges where a puck is, m"""


class Person(Driver):
    """Player with the tactics of the best script and the eyes of a person."""

    def __init__(self):
        self.tactics = make_driver("allround")

    def act(self, view, memory):
        pucks = view.state.bodies.pucks
        noise = view.rng.normal(2 * pucks).reshape(-1, pucks, 2)
        state = view.state.map(lambda x: x.copy())
        state.puck[:] += NOISE * noise
        return self.tactics.act(replace(view, state=state), memory)


OTHERS = [
    pytest.param(name, marks=pytest.mark.slow) for name in ("striker", "allround")
]


@pytest.mark.parametrize("script", ["goalkeeper", *OTHERS])
def test_a_weak_script_loses_to_a_person(script):
    weak = [make_driver(f"{script}:strength=weak")]
    late = {"options": {"reaction": REACTION}}
    score, goals = play_against("duel", Person(), weak, 20, 0, late)
    assert score[0] >= 0.5
    assert goals[0] > 1.0
