"""Commands ``airhockey data``."""
