"""Constants that Python and kernels share: coefficients of methods, codes, offsets in arrays."""
