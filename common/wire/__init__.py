"""The vehicle's UDP protocol: frames in wire units, and their datagrams."""
