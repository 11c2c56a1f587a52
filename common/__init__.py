"""What two services share: the wire, the bus, the settings and a service's life."""
