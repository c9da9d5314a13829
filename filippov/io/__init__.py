"""Solutions and trees as files."""
