"""Environments in the APIs of PettingZoo, Gymnasium, SB3 and TorchRL."""
