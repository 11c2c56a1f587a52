"""The stack on a `zenohd`, where there is one: the router that is used in earnest, with REST."""
