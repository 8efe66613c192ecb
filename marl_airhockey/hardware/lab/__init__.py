"""Virtual lab: a simulated table that speaks the protocols of the real one."""
