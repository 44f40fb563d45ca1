"""Names of the columns of the tables in a `Plant`."""

from __future__ import annotations

# channels: node where it starts and ends, begin of its elements and breaks in their tables
FIRST, SECOND, ELEMENTS, BREAKS = 0, 1, 2, 3
# elements: address of the compiled law, begin of its parameters, address for many points at once
ADDRESS, OFFSET, LANES_ADDRESS = 0, 1, 2
# breaks: on the line displacement*d + velocity*v = value, whether a law jumps there
ON_DISPLACEMENT, ON_VELOCITY, VALUE, IS_JUMP = 0, 1, 2, 3
