"""Training of policies by PPO, and what becomes of a run."""
