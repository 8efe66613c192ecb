"""Backends: physics engines that compute the next state from paddle commands."""
