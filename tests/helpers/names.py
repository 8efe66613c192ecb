"""Names that tests are made for, beside those of the library's lists."""

import marl_airhockey as ah
from marl_airhockey.sim.backends.find import simulated_backend, simulated_names

GOALS = ["hit_goal", "hit_goal_velocity", "reach", "reach_velocity"]


def seats(scenario):
    return len(ah.make_scenario(scenario).scene.seats)


def ideal_backends():
    kinds = {name: simulated_backend(name) for name in simulated_names()}
    return [name for name, kind in kinds.items() if kind.instant_contacts]
