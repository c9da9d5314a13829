"""Systems under another comparator than the inclusion: bands, smooth signs, hysteresis, stick bands."""
