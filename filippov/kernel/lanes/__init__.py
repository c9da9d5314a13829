"""The kernels that run several trajectories side by side."""
