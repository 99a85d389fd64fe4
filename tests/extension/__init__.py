"""What a user can add, added by a test in its own file and run from a scene to a result."""
