"""Learning by playing towards goals, those that were met by chance among them."""
