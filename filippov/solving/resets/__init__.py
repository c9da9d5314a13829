"""Resets and impacts, and the accumulation of their events."""
