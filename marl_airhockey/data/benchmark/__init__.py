"""Named datasets of offline RL, which are built from seeds on the user's machine."""
