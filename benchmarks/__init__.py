"""The same leg and the same horse in engines that nobody here wrote, to compare speed and results with."""
