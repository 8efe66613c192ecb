"""Templates that `airhockey new` copies. Each one is a complete example."""
