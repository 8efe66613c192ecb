"""What scenario and agent files are made with."""
