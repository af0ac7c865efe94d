"""How an export is laid out and what its columns are: found out from the file itself, and written as a mapping."""
