"""What a case expects, read and measured: one module for each kind of quantity."""
