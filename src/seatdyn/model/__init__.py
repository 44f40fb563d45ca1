"""What is described: bodies, suspension elements, seats, base motions, and their assembly."""
