"""Learning of goals in simulation, with hindsight experience replay."""
