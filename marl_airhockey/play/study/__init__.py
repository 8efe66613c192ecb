"""Studies in which people play against opponents in a planned order."""
