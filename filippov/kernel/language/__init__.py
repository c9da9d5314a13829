"""The kernel language and its compiler: Python's syntax tree -> LLVM IR -> machine code."""
