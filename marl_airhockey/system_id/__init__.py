"""Other physics: success of policies there, and identification of its parameters."""
