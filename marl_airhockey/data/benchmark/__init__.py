"""Named datasets for offline RL, which are built from seeds on the user's machine."""
