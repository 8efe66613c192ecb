"""Run by CI on macOS and Windows: the import, and an episode on two backends."""

import marl_airhockey as ah

for backend in ("numba", "pymunk"):
    env = ah.gym_env("juggle", backend=backend)
    env.action_space.seed(0)
    env.reset(seed=0)
    steps, ended = 0, False
    while not ended:
        _, _, terminated, truncated, _ = env.step(env.action_space.sample())
        steps, ended = steps + 1, terminated or truncated
    print(f"{backend}: an episode of {steps} steps")
