"""Export of recordings to datasets of other libraries, and import from them."""
