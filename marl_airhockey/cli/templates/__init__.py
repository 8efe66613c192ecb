"""Templates that `airhockey new` copies: each is a whole example that runs."""
