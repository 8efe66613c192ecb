"""Physics: paddle commands in, the next state out. No backend knows a scenario."""
