"""The exact automaton of a system in other languages: its equations as text, and their runtimes."""
