"""A demonstration on one page: the paper's numbers, an agent compared with scripted gaits, and films."""
