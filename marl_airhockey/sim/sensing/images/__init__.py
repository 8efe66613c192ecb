"""Images that seats observe, rendered by compiled code."""
