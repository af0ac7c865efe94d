"""Soft actor-critic (Haarnoja et al. 2018, arXiv:1812.05905): two critics, learnt temperature, squashed Gaussian."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from igrow.core.arrays import Floats
from igrow.core.planner.policy import ACTIONS, OBSERVATIONS

_LOG_DEVIATION = (-4.0, 1.0)
"""Bounds of the logarithm of the standard deviation."""


@dataclass(frozen=True)
class SacSettings:
    """Sizes and rates; the paper's networks have two layers of 1024, these train on one core."""

    hidden: tuple[int, ...] = (256, 256)
    learning_rate: float = 5e-4
    batch: int = 256
    discount: float = 0.7
    """Of the next day; a day's setpoints act little beyond the days that follow."""
    smoothing: float = 0.01
    """Share of the critics that their targets take over at each step."""
    entropy: float = -0.5
    """Target entropy for each action."""
    memory: int = 200_000
    reward_scale: float = 10.0
    """Rewards of some EUR 0.1 m-2 become numbers of order 1."""


def network(inputs: int, outputs: int, hidden: tuple[int, ...]) -> nn.Sequential:
    """Return a network of linear layers with ReLU between them."""
    layers: list[nn.Module] = []
    for size in hidden:
        layers += [nn.Linear(inputs, size), nn.ReLU()]
        inputs = size
    return nn.Sequential(*layers, nn.Linear(inputs, outputs))


class Actor(nn.Module):
    """Observations (B, 76) to a Gaussian over actions, squashed to -1 to 1."""

    def __init__(self, hidden: tuple[int, ...]) -> None:
        super().__init__()
        self.body = network(OBSERVATIONS, 2 * ACTIONS, hidden)

    def forward(self, observation: Tensor) -> Tensor:
        """Return the mean action, which is what the exported policy does."""
        return torch.tanh(self.body(observation)[:, :ACTIONS])

    def sample(self, observation: Tensor) -> tuple[Tensor, Tensor]:
        """Draw actions (B, 96) and their log-probability (B, 1)."""
        mean, spread = self.body(observation).chunk(2, dim=1)
        low, high = _LOG_DEVIATION
        deviation = torch.exp(low + 0.5 * (high - low) * (torch.tanh(spread) + 1.0))
        normal = torch.distributions.Normal(mean, deviation)
        raw = normal.rsample()
        action = torch.tanh(raw)
        # log(1 - tanh(x)^2) in a form that does not vanish for large x.
        squash = 2.0 * (np.log(2.0) - raw - nn.functional.softplus(-2.0 * raw))
        log_probability: Tensor = normal.log_prob(raw) - squash  # type: ignore[no-untyped-call]
        return action, log_probability.sum(dim=1, keepdim=True)


class Memory:
    """The transitions that the critics learn from; the oldest are overwritten."""

    def __init__(self, size: int) -> None:
        self._size, self._filled, self._next = size, 0, 0
        self._observation = np.zeros((size, OBSERVATIONS), dtype=np.float32)
        self._action = np.zeros((size, ACTIONS), dtype=np.float32)
        self._reward = np.zeros((size, 1), dtype=np.float32)
        self._following = np.zeros((size, OBSERVATIONS), dtype=np.float32)
        self._goes_on = np.zeros((size, 1), dtype=np.float32)

    def __len__(self) -> int:
        return self._filled

    def add(
        self,
        observation: NDArray[np.float32],
        action: NDArray[np.float32],
        reward: Floats,
        following: NDArray[np.float32],
        goes_on: bool,
    ) -> None:
        """Add a batch of transitions."""
        rows = (self._next + np.arange(len(observation))) % self._size
        self._observation[rows], self._action[rows] = observation, action
        self._reward[rows, 0], self._following[rows], self._goes_on[rows] = reward, following, float(goes_on)
        self._next = int((rows[-1] + 1) % self._size)
        self._filled = min(self._size, self._filled + len(rows))

    def draw(self, rng: np.random.Generator, count: int) -> tuple[Tensor, Tensor, Tensor, Tensor, Tensor]:
        """Return observation, action, reward, following observation and whether it goes on."""
        rows = rng.integers(self._filled, size=count)
        observation, action, reward, following, goes_on = (
            torch.from_numpy(array[rows])
            for array in (self._observation, self._action, self._reward, self._following, self._goes_on)
        )
        return observation, action, reward, following, goes_on


class SoftActorCritic:
    """The learner."""

    def __init__(self, settings: SacSettings, seed: int) -> None:
        torch.manual_seed(seed)
        self.settings = settings
        self.rng = np.random.default_rng(seed)
        self.actor = Actor(settings.hidden)
        self.critics, self.targets = (
            [network(OBSERVATIONS + ACTIONS, 1, settings.hidden) for _ in range(2)] for _ in range(2)
        )
        for critic, target in zip(self.critics, self.targets, strict=True):
            target.load_state_dict(critic.state_dict())
        self.log_temperature = torch.tensor(-2.0, requires_grad=True)
        self.memory = Memory(settings.memory)
        rate = settings.learning_rate
        self._actor_steps = torch.optim.Adam(self.actor.parameters(), rate)
        weights = [weight for critic in self.critics for weight in critic.parameters()]
        self._critic_steps = torch.optim.Adam(weights, rate)
        self._temperature_steps = torch.optim.Adam([self.log_temperature], rate)

    def act(self, observation: NDArray[np.float32], *, explore: bool) -> NDArray[np.float32]:
        """Return actions (B, 96), drawn or the mean ones."""
        with torch.no_grad():
            given = torch.from_numpy(observation)
            action = self.actor.sample(given)[0] if explore else self.actor(given)
        return np.asarray(action.numpy(), dtype=np.float32)

    def learn(self) -> None:
        """Take one step on critics, actor and temperature."""
        s = self.settings
        observation, action, reward, following, goes_on = self.memory.draw(self.rng, s.batch)
        temperature = self.log_temperature.exp().detach()
        with torch.no_grad():
            ahead, log_probability = self.actor.sample(following)
            worth = torch.minimum(*(target(torch.cat([following, ahead], 1)) for target in self.targets))
            goal = s.reward_scale * reward + s.discount * goes_on * (worth - temperature * log_probability)
        given = torch.cat([observation, action], 1)
        critic_loss = sum(nn.functional.mse_loss(critic(given), goal) for critic in self.critics)
        self._step(self._critic_steps, critic_loss)

        chosen, log_probability = self.actor.sample(observation)
        worth = torch.minimum(*(critic(torch.cat([observation, chosen], 1)) for critic in self.critics))
        self._step(self._actor_steps, (temperature * log_probability - worth).mean())
        surplus = (log_probability + s.entropy * ACTIONS).mean().detach()
        self._step(self._temperature_steps, -self.log_temperature * surplus)
        with torch.no_grad():
            for critic, target in zip(self.critics, self.targets, strict=True):
                for ours, theirs in zip(critic.parameters(), target.parameters(), strict=True):
                    theirs.lerp_(ours, s.smoothing)

    @staticmethod
    def _step(optimiser: torch.optim.Optimizer, loss: Tensor | float) -> None:
        assert isinstance(loss, Tensor)
        optimiser.zero_grad()
        loss.backward()  # type: ignore[no-untyped-call]
        optimiser.step()
