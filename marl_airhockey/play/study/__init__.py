"""Studies: people play against opponents in the order of a plan."""
