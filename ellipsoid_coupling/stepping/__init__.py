"""How long steps are, for every model: tried, judged, repeated, counted."""
