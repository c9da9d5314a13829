"""The generation, compilation and caching of a system's unit of machine code."""
