"""The earlier form of a bank, whose expectations are understood by name, made into that of today.

All guessing stands here: regular expressions, and several readings of one name, of which the nearest counts.
It is part of the package, and no script beside it, because files of the earlier form are what people have:
`filippov bank run` takes them as they are.
"""
