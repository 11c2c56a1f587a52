"""A camera on the bus: pictures that carry their age."""
