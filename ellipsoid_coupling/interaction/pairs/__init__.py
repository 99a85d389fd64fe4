"""The pair sum over particles, with a cell list."""
