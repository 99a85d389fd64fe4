"""The plane that all models share: walls that reflect, and the bins that all results are counted in."""
