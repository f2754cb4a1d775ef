"""The slow, obvious mechanics that the engine is tested against; it shares no formula with it."""
