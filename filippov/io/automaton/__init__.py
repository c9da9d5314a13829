"""The exact automaton of a system in other languages: its expressions as text, and their runtimes."""
