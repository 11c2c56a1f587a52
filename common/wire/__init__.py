"""The vehicle's UDP protocol: frames in wire units, and datagrams made of them."""
