"""The APIs: PettingZoo, Gymnasium, stable-baselines3."""
