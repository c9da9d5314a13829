"""What makes a unit of machine code for a system, and keeps it."""
