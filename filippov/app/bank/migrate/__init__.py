"""The earlier form of a bank, whose expectations are understood by name, made into that of today.

All guessing is here: regular expressions, and several readings of one name, of which the nearest counts. It
is part of the package, and not a script beside it, because people have files of the earlier form: `filippov
bank run` accepts them as they are.
"""
