"""Commands ``airhockey calibrate``."""
