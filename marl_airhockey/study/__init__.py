"""Studies: people play against opponents in an order that a plan says."""
