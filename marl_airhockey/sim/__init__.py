"""Simulation: tables, physics, sensing, worlds and their images."""
