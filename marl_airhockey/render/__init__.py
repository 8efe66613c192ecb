"""Pictures, windows and videos."""
