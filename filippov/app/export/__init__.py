"""The command `filippov export`: a model as a program in another language."""
