"""The command line; it adds no physics."""
