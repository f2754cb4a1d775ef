"""The same leg and the same horse in independent engines, to compare speed and results with."""
