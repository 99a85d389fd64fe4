"""The formulas of the model as scalar kernels, each with its equation; nothing numerical here."""
