"""What a scenario, a driver and a backend owe."""
