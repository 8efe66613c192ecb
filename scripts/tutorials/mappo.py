"""MAPPO in one file: teammates share a policy, and a critic observes the true state.

    python scripts/tutorials/mappo.py --updates 150

`make_world` steps all worlds in one call and restarts those that end. `critic_state`
returns the true state, which no agent observes. In rally both agents get a reward when
the puck crosses the middle.
"""

from __future__ import annotations

from typing import Annotated, Any

import numpy as np
import torch
import typer
from torch import Tensor, nn

import marl_airhockey as ah

WORLDS, STEPS, EPOCHS, BATCH = 512, 32, 4, 4096
GAMMA, LAMBDA, CLIP, RATE = 0.99, 0.95, 0.2, 1e-3


def network(scale: np.ndarray, outputs: int) -> nn.Module:
    """Return a network with two hidden layers.

    Args:
        scale: Largest values of the inputs, (D,).
        outputs: Number of outputs.
    """
    first, second = nn.Linear(len(scale), 64), nn.Linear(64, 64)
    first.weight.data /= torch.as_tensor(scale)
    return nn.Sequential(*(first, nn.Tanh(), second, nn.Tanh()), nn.Linear(64, outputs))


def advantages(reward: Tensor, value: Tensor, last: Tensor, alive: Tensor) -> Tensor:
    """Return generalized advantage estimates (T, B); ``alive`` is 0 at an end."""
    found, running, following = torch.zeros_like(reward), torch.zeros_like(last), last
    for t in reversed(range(len(reward))):
        error = reward[t] + GAMMA * following * alive[t] - value[t]
        running = error + GAMMA * LAMBDA * alive[t] * running
        found[t], following = running, value[t]
    return found


def main(
    updates: Annotated[int, typer.Option(help="Number of rollouts.")] = 150,
    game: Annotated[str, typer.Option(help="Name of a game with one team.")] = "rally",
    seed: Annotated[int, typer.Option()] = 0,
) -> None:
    """Train, print the mean reward of a step, and measure the policy."""
    torch.set_num_threads(1)  # Small networks are slower with several threads.
    torch.manual_seed(seed)
    world = ah.make_world(game, WORLDS)
    seen = torch.as_tensor(world.reset(seed))
    policy = network(world.observation_space.high, 2)
    critic = network(world.critic_state_space.high, 1)
    log_std = nn.Parameter(torch.full((2,), -0.5))
    parameters = [*policy.parameters(), *critic.parameters(), log_std]
    optimizer = torch.optim.Adam(parameters, RATE)

    def spread(observed: Tensor) -> Any:
        return torch.distributions.Normal(policy(observed), log_std.exp())

    for update in range(updates):
        rows: list[tuple[Tensor, ...]] = []
        with torch.no_grad():
            for _ in range(STEPS):
                state = torch.as_tensor(world.critic_state())
                action = spread(seen).sample()
                log_prob = spread(seen).log_prob(action).sum((-1, -2))
                step = world.step(action.clamp(-1, 1).double().numpy())
                reward = torch.as_tensor(step.reward[:, 0], dtype=torch.float32)
                ended = torch.as_tensor(step.terminated | step.truncated)
                value = critic(state)[:, 0]
                rows.append((seen, state, action, log_prob, reward, value, ~ended))
                seen = torch.as_tensor(step.observation)
            last = critic(torch.as_tensor(world.critic_state()))[:, 0]
        obs, states, actions, old, rewards, values, alive = (
            torch.stack(column) for column in zip(*rows, strict=True)
        )
        gain = advantages(rewards, values, last, alive.float())
        target = (gain + values).flatten()
        gain = ((gain - gain.mean()) / (gain.std() + 1e-8)).flatten()
        flat = [x.flatten(0, 1) for x in (obs, states, actions, old)]
        for _ in range(EPOCHS):
            order = torch.randperm(len(target))
            for k in range(0, len(order), BATCH):
                rows_of = order[k : k + BATCH]
                o, s, a, before = (x[rows_of] for x in flat)
                ratio = (spread(o).log_prob(a).sum((-1, -2)) - before).exp()
                clipped = ratio.clamp(1 - CLIP, 1 + CLIP)
                surrogate = torch.min(ratio * gain[rows_of], clipped * gain[rows_of])
                error = (critic(s)[:, 0] - target[rows_of]) ** 2
                loss = 0.5 * error.mean() - surrogate.mean()
                optimizer.zero_grad()
                loss.backward()
                nn.utils.clip_grad_norm_(parameters, 0.5)
                optimizer.step()
        if update % 10 == 9:
            print(f"{update + 1}: reward of a step {float(rewards.mean()):.4f}")
    teammates = dict.fromkeys((f"paddle_{i}" for i in world.open[1:]), policy)
    found = ah.evaluate(policy, game, episodes=200, drivers=teammates)
    print(f"return {found.returns:.2f}, success {found.success:.3f}")


if __name__ == "__main__":
    typer.run(main)
