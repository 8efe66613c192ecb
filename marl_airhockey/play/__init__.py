"""Play in a browser: people, policies and scripts at one table."""
