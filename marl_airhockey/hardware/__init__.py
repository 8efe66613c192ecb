"""Hardware: cameras, robots and the table that they make, real or emulated."""
