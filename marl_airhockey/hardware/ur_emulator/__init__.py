"""Controller: a UR5e's, simulated, with the network protocols of the real one."""
