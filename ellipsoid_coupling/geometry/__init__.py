"""The plane that all models share: what happens at its sides, and the bins that results are counted in."""
