"""Training of policies, and the folders of training runs."""
