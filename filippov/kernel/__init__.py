"""What is compiled: tables, the kernel language, the event loop, and the code of a system."""
