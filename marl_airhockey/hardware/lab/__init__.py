"""Virtual lab: a simulated table with the network protocols of the real one."""
