"""Numbers that Python and kernels share: coefficients of methods, codes, places in arrays."""
