"""Data: what recordings hold, how they are made, and how they become worlds again."""
