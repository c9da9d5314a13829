"""The kernels of the event loop: arrays in, arrays out."""
