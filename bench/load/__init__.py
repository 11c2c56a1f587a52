"""How much the bridge bears, and what the chain on board takes of the machine."""
