"""Ground reaction force records as files that statistics and gait-lab tools open."""
