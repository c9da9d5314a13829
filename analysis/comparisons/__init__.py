"""The exact inclusion against band models."""
