"""The gallery: short models from friction, control, power, impacts, biology and climate, and textbooks."""
