"""Play in the browser: people, policies and scripts at one table."""
