"""Content of JSON files that a command did not write."""

CUT = '{"versions": {"commit": "1"}, "rows": [[1, 2'
"""File that was cut off."""

FOREIGN = ("", "[]", "7", "null", '"text"', '{"searches": 3}', '{"found": {"seed": 0}}', "[" * 100000)
"""Files of something else, one of them nested too deep."""
